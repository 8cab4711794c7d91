"""People who are in no data set, in moments of motions that are no start poses, and their scans."""

from dataclasses import replace

import numpy as np
from open_bodies import model_with
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

import riemhuman as rh
from riemhuman.bodies.skinning import SMPL_JOINTS, SMPL_PARENTS, usual_joint_names
from riemhuman.datasets.open_bodies import surface_noise
from riemhuman.registration import RegistrationSettings
from riemhuman.registration._arms_and_hands import BodyFit, fit_arms_and_hands
from riemhuman.registration._crossed_limbs import uncross_limbs
from riemhuman.registration._dense_fit import fit_densely
from riemhuman.registration._elastic_step import leave_model
from riemhuman.registration._pipeline import ScanTask, fit_and_judge, register_whole
from riemhuman.registration._scan_preparation import prepare_scan
from riemhuman.registration._start_poses import rename_joints
from riemhuman.registration._start_search import search_scan
from riemhuman.registration.scan_registration import known_body, result_of
from riemhuman.registration.scans import as_scan
from riemhuman.registration.simulated_scans import remesh
from riemhuman.surfaces.nearest_points import nearest_points

MOTIONS = (
    "chicken_wings",
    "hips",
    "jumping_jacks",
    "knees",
    "light_hopping_loose",
    "one_leg_jump",
    "one_leg_loose",
    "punching",
    "running_on_spot",
    "shake_arms",
)
N_PEOPLE = 10
_FRAMES = (37, 91)
_DETAIL_METRES, _WAVELENGTHS = 0.001, (0.1, 0.4)


def bodies_to_scan(model, seed):
    """Yield subject, moment and surface of a hundred bodies, ten people in ten moments.

    Every person has a shape of its own, a way of its own to move, and a surface that differs by a
    millimetre from what the model can show.
    """
    resolution = "full" if model.n_vertices > 5000 else "coarse"
    motions = rh.datasets.load_open_motions(resolution, sequences=list(MOTIONS))
    rng = np.random.default_rng([seed, 15])
    builds = np.clip(rng.standard_normal((N_PEOPLE, model.n_betas)), -2.0, 2.0)
    # So many adults are the model's first ten coefficients for.
    builds[:, 10:] = 0.0
    frames = rng.integers(*_FRAMES, len(MOTIONS))
    for subject in range(N_PEOPLE):
        performed = motions[subject * len(MOTIONS) : (subject + 1) * len(MOTIONS)]
        for moment, (motion, frame) in enumerate(zip(performed, frames, strict=True)):
            posture = motion.pose_vectors[frame], motion.translations[frame]
            detail = surface_noise(model.template.vertices, _DETAIL_METRES, _WAVELENGTHS, rng)
            yield subject, moment, model(builds[subject], *posture) + detail


def scans_of(bodies, faces, seed, numbers=None, **options):
    """Yield number, subject, moment and scan: remeshed, 2 mm noise, 10 % in holes, any heading."""
    chosen = {"n_points": 12_000, "mesh": True, "noise": 0.002, "missing": 0.1} | options
    for number, (subject, moment, surface) in enumerate(bodies):
        if numbers is None or number in numbers:
            rng = np.random.default_rng([seed, number])
            scan = rh.registration.simulated_scan(surface, faces, rng, **chosen)
            yield number, subject, moment, scan


N_FOREIGN_VERTICES = 6890


def foreign_bodies(model, seed, n_people, n_moments):
    """Return bodies that the model cannot make, their triangles, and their vertices' places on it.

    The bodies are an array of shape (people, moments, 6890, 3). Limbs are longer or shorter, all of
    the surface is bent by smooth waves of 12 mm, fingers curl by up to 60 degrees, which no joint
    of the model does, and the mesh is another.
    """
    rng = np.random.default_rng([seed, 6890])
    rest, faces = model.template.vertices, model.faces
    vertices, triangles = remesh(rest, faces, N_FOREIGN_VERTICES, rng)
    places, _ = nearest_points(vertices, rest, faces)
    motions = rh.datasets.load_open_motions(
        "full" if model.n_vertices > 5000 else "coarse", sequences=list(MOTIONS)
    )
    surfaces = np.empty((n_people, n_moments, len(places.triangles), 3))
    for person in range(n_people):
        person_model = model_with(model, v_template=foreign_shape(model, rng))
        for moment in range(n_moments):
            motion = motions[rng.integers(len(motions))]
            posed = person_model(pose=motion.pose_vectors[rng.integers(len(motion))])
            surfaces[person, moment] = points_at(places, posed, faces)
    return surfaces, triangles, places


def foreign_shape(model, rng):
    """Return the rest surface of such a person."""
    shaped = model(np.clip(0.7 * rng.standard_normal(model.n_betas), -1.5, 1.5))
    waves = surface_noise(model.template.vertices, 0.012, (0.3, 0.8), rng)
    scale = np.exp(rng.normal(0.0, 0.03, 3))
    curl = np.radians(rng.uniform(0.0, 60.0, 2))
    for side, angle in zip(("left", "right"), curl, strict=True):
        shaped = curled(model, shaped, model.joint_names.index(f"{side}_wrist"), angle)
    return scale * shaped + waves


def curled(model, surface, wrist, angle):
    """Return a surface whose fingers turn about a line across the hand, more towards their tips."""
    hand = model.weights[:, wrist] > 0.5
    centre = surface[hand].mean(axis=0)
    start = model.joint_regressor[wrist] @ surface
    along = (centre - start) / np.linalg.norm(centre - start)
    # Across the hand is the direction of its largest spread but for its length.
    flat = surface[hand] - centre
    flat = flat - np.outer(flat @ along, along)
    across = np.linalg.svd(flat, full_matrices=False)[2][0]
    length = np.maximum((surface - centre) @ along, 0.0) * hand
    turns = Rotation.from_rotvec(np.outer(angle * length / max(length.max(), 1e-9), across))
    return np.where(hand[:, None], turns.apply(surface - centre) + centre, surface)


def points_at(places, surface, faces):
    """Return the positions of places on a surface."""
    return np.einsum("nk,nkx->nx", places.barycentric, surface[faces[places.triangles]])


FOREARMS = ("left_elbow", "left_wrist", "right_elbow", "right_wrist")


def with_inward_arms(model, scan):
    """Return triangles of a scan in three parts, whose forearms face inward, and which ones do."""
    names = model.joint_names
    owners = model.weights.argmax(axis=1)[cKDTree(scan.body).query(scan.points)[1]]
    on_arm = np.isin(owners, [names.index(name) for name in FOREARMS])[scan.faces]
    arms, others = scan.faces[on_arm.all(axis=1)], scan.faces[~on_arm.any(axis=1)]
    faces = np.concatenate([others, arms[:, ::-1]])
    return faces, np.repeat([False, True], [len(others), len(arms)])


def sparse_floor(scan, rng, n_points=196):
    """Return sparse points of a floor around the feet of a scan."""
    floor = rng.uniform(-0.5, 0.5, (n_points, 3)) * [1.0, 0.004, 1.0]
    centre = scan.body.mean(axis=0)
    return floor + [centre[0], scan.body[:, 1].min(), centre[2]]


def bun(model, scan, rng, n_points=400, radius=0.05):
    """Return points of a hair bun at the back of the head of a scan."""
    head = scan.body[model.weights.argmax(axis=1) == model.joint_names.index("head")]
    middle = head.mean(axis=0)
    toes = [model.joint_names.index(f"{side}_toes") for side in ("left", "right")]
    joints = model.joint_regressor @ scan.body
    ankles = [model.joint_names.index(f"{side}_ankle") for side in ("left", "right")]
    backward = (joints[ankles] - joints[toes]).mean(axis=0) * [1.0, 0.0, 1.0]
    backward /= np.linalg.norm(backward)
    centre = middle + ((head - middle) @ backward).max() * backward + [0.0, 0.04, 0.0]
    around = rng.standard_normal((n_points, 3))
    around[around @ backward < 0.0] *= -1.0  # the other half is within the head
    return centre + radius * around / np.linalg.norm(around, axis=1, keepdims=True)


def wrong_starts(registration, result):
    """Yield names and poses in which a registered body turns round, or limbs change sides."""
    model, pose = registration.model, result.fit.pose
    names = usual_joint_names(model)
    other_side = {"left": "right", "right": "left"}
    mirrored = np.empty_like(pose)
    for k, name in enumerate(names):
        side, _, joint = name.partition("_")
        twin = names.index(f"{other_side[side]}_{joint}") if side in other_side else k
        mirrored[k] = pose[twin] * [1.0, -1.0, -1.0]
    root = int(np.flatnonzero(model.parents < 0)[0])
    turned = (Rotation.from_rotvec(pose[root]) * Rotation.from_rotvec([0, np.pi, 0])).as_rotvec()
    for name, limbs in {
        "turned": [],
        "turned and mirrored": names,
        "arms exchanged": ["shoulder", "elbow", "wrist", "collar"],
        "legs exchanged": ["hip", "knee", "ankle"],
    }.items():
        wrong = pose.copy()
        exchanged = [
            k for k, joint in enumerate(names) if joint in limbs or joint.split("_")[-1] in limbs
        ]
        wrong[exchanged] = mirrored[exchanged]
        if name.startswith("turned"):
            wrong[root] = turned
        surface = model(np.zeros(model.n_betas), wrong)
        shift = result.points.mean(axis=0) - surface.mean(axis=0)
        betas = np.zeros(model.n_betas)
        fit = replace(result.fit, betas=betas, pose=wrong, trans=shift)
        yield name, replace(result, fit=fit, likelihood=-np.inf)


def other_starts(registration, result, rng, n_starts=2):
    """Yield names, poses and shapes of other people in moments of motions, at a body's place."""
    model = registration.model
    resolution = "full" if model.n_vertices > 5000 else "coarse"
    motions = rh.datasets.load_open_motions(resolution, sequences=list(MOTIONS))
    root = int(np.flatnonzero(model.parents < 0)[0])
    for _ in range(n_starts):
        motion = motions[rng.integers(len(motions))]
        pose = motion.pose_vectors[rng.integers(len(motion))].copy()
        pose[root] = result.fit.pose[root]
        betas = rng.standard_normal(model.n_betas)
        shift = result.points.mean(axis=0) - model(betas, pose).mean(axis=0)
        fit = replace(result.fit, betas=betas, pose=pose, trans=shift)
        yield "another person", replace(result, fit=fit, likelihood=-np.inf)


# Joints with a smaller share of the vertices are no limbs.
_LIMB = 0.01
# Vertices this near to a point of the scan, under clothes too, are shown by it.
_SHOWN_METRES = 0.05


def results_to_trust_or_not(registration, points, truth, places, rng):
    """Yield start, mean error, that of the worst limb (metres) and result of a registration.

    It is followed by results from starts that are deliberately wrong, before `solve` would try
    others. `places` are those of the true vertices on the model, None if they are its own. The mean
    error is that of the trusted vertices, of all if none is trusted; that of a limb is of what the
    scan shows, trusted or not.
    """
    task = task_of(registration, points)
    model = registration.model
    faces, owners = model.faces, model.weights.argmax(axis=1)
    if places is not None:
        owners = owners[faces[places.triangles, 0]]
    shown = cKDTree(points).query(truth)[0] < _SHOWN_METRES
    counts = np.bincount(owners[shown])

    def solved(start):
        if start is None:
            result = registration.solve(points)
        else:
            result = result_of(register_whole(task, known_body(task.body, start)), trace=False)
        surface, chosen = result.points, result.trusted_vertices
        if places is not None:
            surface, chosen = points_at(places, surface, faces), chosen[faces[places.triangles, 0]]
        errors = np.linalg.norm(surface - truth, axis=1)
        of_limbs = np.bincount(owners[shown], errors[shown]) / np.maximum(counts, 1)
        worst = of_limbs[counts > _LIMB * len(owners)].max()
        return float(errors[chosen if chosen.any() else ~chosen].mean()), float(worst), result

    error, worst, first = solved(None)
    yield "search", error, worst, first
    for name, start in [
        *wrong_starts(registration, first),
        *other_starts(registration, first, rng),
    ]:
        yield name, *solved(start)


def settings_with(**search):
    """Return settings of the search."""
    return RegistrationSettings(**search)


def task_of(registration, points):
    """Return the task of registering a scan whose direction up is said."""
    axes = {None: None, "x": np.eye(3)[0], "y": np.eye(3)[1], "z": np.eye(3)[2]}
    up = axes[registration.up]
    prepared = replace(prepare_scan(as_scan(points), up=up), clothed=registration.clothed)
    return ScanTask(registration._body, prepared, up is not None, unit_is_known=False)


def result_of_one_search(registration, points):
    """Return the result of the first search, before `solve` would try others."""
    task = task_of(registration, points)
    search = search_scan(task.body, task.scan)
    return result_of(fit_and_judge(search), trace=False)


def fit_body(body, start, scan):
    """Return the fit of a body to a prepared scan from one candidate."""
    dense = uncross_limbs(fit_densely(body, start, scan))
    arms = fit_arms_and_hands(dense)
    elastic = leave_model(arms.task, arms.pose)
    return BodyFit(arms.task, elastic, arms.arm_fits, arms.hand_fits)


def with_smpls_tree(model):
    """Return the open model with SMPL's joints in SMPL's order, without names."""
    order = [model.joint_names.index(name) for name in SMPL_JOINTS]
    weights = model.weights[:, order].copy()
    chest, upper = model.joint_names.index("chest"), SMPL_JOINTS.index("upper_spine")
    weights[:, upper] += model.weights[:, chest]
    return model_with(
        model,
        joint_regressor=model.joint_regressor[order],
        weights=weights / weights.sum(axis=1, keepdims=True),
        kintree_table=np.stack([SMPL_PARENTS, np.arange(len(order))]),
        joint_names=None,
        hand_directions=None,
        hand_poses=(),
    )


def with_other_names(model):
    """Return a model whose joints have names that no other model has."""
    return rename_joints(model, tuple(f"bone_{k}" for k in range(model.n_joints)))


def registered_at(body, faces):
    """Return a result as of a registration that found a body itself: its vertices are the scan."""
    over = rh.registration.lay_over_body((body, faces), body, faces)
    places, _ = nearest_points(body, body, faces)
    return rh.registration.RegisteredScan(
        points=body,
        trusted=True,
        trusted_vertices=over.seen,
        message="",
        likelihood=np.nan,
        fit=None,
        distances=np.abs(over.distances),
        matched=over.seen,
        correspondence=places,
        background=over.background,
        up=np.array([0.0, 1.0, 0.0]),
        transform=np.eye(4),
        unit="metres",
        faces=faces,
        scan=rh.registration.Scan(body, faces),
    )
