"""People who are in no data set, in moments of motions that are no start poses, and their scans."""

import numpy as np
from scipy.spatial.transform import Rotation

import riemhuman as rh
from riemhuman.datasets._natural_bodies import surface_noise
from riemhuman.registration._start_poses import _SMPL_TREE, rename_joints
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
        own = motions[subject * len(MOTIONS) : (subject + 1) * len(MOTIONS)]
        for moment, (motion, frame) in enumerate(zip(own, frames, strict=True)):
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
    """Return surfaces that the model cannot make, shape (people, moments, 6890, 3), and triangles.

    Limbs are longer or shorter, all of the surface is bent by smooth waves of 12 mm, fingers curl
    by up to 60 degrees, which no joint of the model does, and the mesh is another.
    """
    rng = np.random.default_rng([seed, 6890])
    rest, faces = model.template.vertices, model.faces
    vertices, triangles = remesh(rest, faces, N_FOREIGN_VERTICES, rng)
    places, _ = nearest_points(vertices, rest, faces)
    names = list(model.joint_names)
    motions = rh.datasets.load_open_motions(
        "full" if model.n_vertices > 5000 else "coarse", sequences=list(MOTIONS)
    )
    surfaces = np.empty((n_people, n_moments, len(vertices), 3))
    for person in range(n_people):
        shaped = model(np.clip(0.7 * rng.standard_normal(model.n_betas), -1.5, 1.5))
        waves = surface_noise(rest, 0.012, (0.3, 0.8), rng)
        scale = np.exp(rng.normal(0.0, 0.03, 3))
        curl = np.radians(rng.uniform(0.0, 60.0, 2))
        for side, angle in zip(("left", "right"), curl, strict=True):
            shaped = _curled(model, shaped, names.index(f"{side}_wrist"), angle)
        own = rh.BodyModel(
            scale * shaped + waves,
            faces,
            np.zeros((model.n_vertices, 3, 1)),
            model.joint_regressor,
            model.weights,
            np.stack([model.parents, np.arange(model.n_joints)]),
        )
        for moment in range(n_moments):
            motion = motions[rng.integers(len(motions))]
            posed = own(pose=motion.pose_vectors[rng.integers(len(motion))])
            corners = posed[faces[places.triangles]]
            surfaces[person, moment] = np.einsum("nk,nkx->nx", places.barycentric, corners)
    return surfaces, triangles


def _curled(model, surface, wrist, angle):
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


def correspondence_errors(one, other, first, second, faces):
    """Return how far from its truth every vertex of one foreign body goes on another, metres."""
    places, _ = nearest_points(one, first, faces)
    carried = np.einsum("nk,nkx->nx", places.barycentric, second[faces[places.triangles]])
    return np.linalg.norm(carried - other, axis=1)


def with_smpls_tree(model):
    """Return the open model with SMPL's joints in SMPL's order, without names."""
    order = [model.joint_names.index(name) for name in _SMPL_TREE]
    weights = model.weights[:, order].copy()
    chest, upper = model.joint_names.index("chest"), list(_SMPL_TREE).index("upper_spine")
    weights[:, upper] += model.weights[:, chest]
    return rh.BodyModel(
        model.template.vertices,
        model.faces,
        model.shapedirs,
        model.joint_regressor[order],
        weights / weights.sum(axis=1, keepdims=True),
        np.stack([list(_SMPL_TREE.values()), np.arange(len(order))]),
    )


def with_other_names(model):
    """Return a model whose joints have names that no other model has."""
    return rename_joints(model, tuple(f"bone_{k}" for k in range(model.n_joints)))
