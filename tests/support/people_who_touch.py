"""People whose hands, arms or feet touch, and scans that show one surface where two touch."""

from dataclasses import dataclass

import numpy as np
from open_bodies import model_with
from scanned_people import curled
from scipy.optimize import least_squares
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

import riemhuman as rh
from riemhuman.datasets.open_bodies import surface_noise
from riemhuman.kernels.surface import unit_vectors, vertex_normals

# Degrees from the T-pose, as for `rh.datasets.joint_rotations`, and pairs of places that touch.
# A place with a side is that of the hand or arm of this side.
_HANGING = {"shoulder": ("xz", 10, -58), "hip": ("z", 4)}
_ACROSS = {"shoulder": ("xyz", -20, -35, -62), "elbow": ("y", -95), "hip": ("z", 4)}
POSTURES = {
    "hands clasped": (
        {"shoulder": ("xyz", -10, -30, -62), "elbow": ("y", -85), "hip": ("z", 4)},
        (("left palm", "right palm"),),
    ),
    "arms folded": (
        _ACROSS,
        (
            ("left palm", "right upper arm"),
            ("right palm", "left upper arm"),
            ("left forearm", "right forearm back"),
        ),
    ),
    "hands on belly": (_ACROSS, (("left palm", "left belly"), ("right palm", "right belly"))),
    "hand over hand": (_ACROSS, (("right palm", "belly"), ("left palm", "right back of hand"))),
    "hands on hips": (
        {"shoulder": ("xyz", 50, 12, -48), "elbow": ("y", -88), "hip": ("z", 9)},
        (("left palm", "left hip"), ("right palm", "right hip")),
    ),
    "hands on thighs": (
        {**_HANGING, "elbow": ("y", -25)},
        (("left palm", "left thigh"), ("right palm", "right thigh")),
    ),
    "hands behind the back": (
        {"shoulder": ("xyz", 55, 40, -65), "elbow": ("y", -60), "hip": ("z", 4)},
        (("left palm", "left back"), ("right palm", "left back of hand")),
    ),
    "hands at the pockets": (
        {"shoulder": ("xyz", 25, 15, -60), "elbow": ("y", -55), "hip": ("z", 4)},
        (("left palm", "left pocket"), ("right palm", "right pocket")),
    ),
    "wrists crossed": (
        {"shoulder": ("xyz", -10, -35, -60), "elbow": ("y", -40), "hip": ("z", 4)},
        (("left wrist", "right wrist back"),),
    ),
    "feet crossed": (
        {
            "shoulder": ("xz", 10, -55),
            "elbow": ("y", -18),
            "left_hip": ("zx", -13, -8),
            "right_hip": ("zx", 11, 8),
            "left_knee": ("x", 6),
        },
        (),
    ),
    "arms hanging": ({**_HANGING, "elbow": ("y", -20)}, ()),
}
# On the left side of the rest pose, metres.
_ON_TRUNK = {
    "belly": (0.045, 1.04, 0.12),
    "hip": (0.155, 1.0, 0.01),
    "thigh": (0.17, 0.70, 0.06),
    "back": (0.03, 1.0, -0.13),
    "pocket": (0.16, 0.86, 0.05),
}
_PALM = np.array([-0.669, -0.691, -0.274])  # the direction that the left palm faces
_PATCH_METRES, _FACING_METRES = 0.03, 0.05
_MISS_METRES, _TILT_RADIANS, _ROTATION_RADIANS = 0.004, 0.3, 0.5
_PLACE_METRES, _JOINT_DEGREES = 0.02, 4.0
_HANDS_TOGETHER = np.array([0.0, 1.05, 0.28])
# Skin nearer to other skin than this is not seen; skin farther within the body than that is not
# looked for, metres.
_CONTACT_METRES, _INSIDE_METRES, _APART_METRES = 0.008, 0.05, 0.15


@dataclass(frozen=True)
class Person:
    """The shape of a person that the model cannot make, at any resolution."""

    betas: np.ndarray
    hands: np.ndarray  # coefficients of the poses of the hands
    scale: np.ndarray  # along the three axes
    curl: np.ndarray  # radians by which the fingers of either hand bend besides
    waves: int  # seed of the detail of the surface

    def body(self, model):
        """Return the person as the mean of a model."""
        shaped = model(self.betas, hands=self.hands)
        for side, angle in zip(("left", "right"), self.curl, strict=True):
            shaped = curled(model, shaped, model.joint_names.index(f"{side}_wrist"), angle)
        rng = np.random.default_rng(self.waves)
        waves = surface_noise(model.template.vertices, 0.010, (0.3, 0.8), rng)
        return model_with(model, v_template=self.scale * shaped + waves)


def any_person(model, rng):
    """Return a person with a shape and hands of their own."""
    poses = [model.hand_pose(name).reshape(2, -1) for name in model.hand_poses]
    both = [poses[rng.integers(len(poses))][side] * rng.uniform() for side in (0, 1)]
    return Person(
        betas=np.clip(0.7 * rng.standard_normal(model.n_betas), -1.5, 1.5),
        hands=np.concatenate(both),
        scale=np.exp(rng.normal(0.0, 0.03, 3)),
        curl=np.radians(rng.uniform(0.0, 30.0, 2)),
        waves=int(rng.integers(2**31)),
    )


def people_who_touch(model, seed, n_people, postures=tuple(POSTURES)):
    """Yield posture and surface of so many people in each posture."""
    coarse = rh.datasets.load_open_model("coarse")
    for person in range(n_people):
        rng = np.random.default_rng([seed, person])
        someone = any_person(coarse, rng)
        coarse_model, fine = someone.body(coarse), someone.body(model)
        for name in postures:
            yield name, fine(pose=touching_pose(coarse, coarse_model, name, rng))


def touching_pose(model, person, posture, rng):
    """Return the pose vectors of a person in which the places of a posture touch."""
    angles, contacts = POSTURES[posture]
    rotations = rh.datasets.joint_rotations(angles, model)
    offsets = Rotation.from_rotvec(rng.normal(0.0, _JOINT_DEGREES, (len(rotations), 3)), True)
    written = rh.bodies.rotation_matrix(
        rh.datasets.pose_vectors(offsets.as_matrix() @ rotations, model)
    )
    vectors = Rotation.from_matrix(written).as_rotvec()
    patches = [[_patch(model, place, rng) for place in pair] for pair in contacts]
    arms = [
        model.joint_names.index(f"{side}_{joint}")
        for side in ("left", "right")
        for joint in ("shoulder", "elbow", "wrist")
    ]

    def posed(offsets):
        turned = Rotation.from_rotvec(offsets.reshape(-1, 3)).as_matrix() @ written[arms]
        pose = vectors.copy()
        pose[arms] = Rotation.from_matrix(turned).as_rotvec()
        return pose

    def residuals(offsets):
        surface = person(pose=posed(offsets))
        normals = vertex_normals(surface, model.faces)
        parts = [offsets / _ROTATION_RADIANS]
        for first, second in patches:
            places = [surface[patch].mean(axis=0) for patch in (first, second)]
            facing = [unit_vectors(normals[patch].mean(axis=0)) for patch in (first, second)]
            parts += [(places[0] - places[1]) / _MISS_METRES, (facing[0] + facing[1])]
            parts[-1] = parts[-1] / _TILT_RADIANS
        if posture in ("hands clasped", "wrists crossed"):
            parts.append((places[0] - _HANDS_TOGETHER) / 0.1)
        return np.concatenate(parts)

    if not patches:
        return vectors
    solved = least_squares(residuals, np.zeros(3 * len(arms)), diff_step=1e-5, max_nfev=25)
    return posed(solved.x)


def _patch(model, place, rng):
    """Return the vertices around a place in the rest pose."""
    side, _, what = place.partition(" ")
    mirror = np.array([-1.0 if side == "right" else 1.0, 1.0, 1.0])
    rest, joints = (
        model.template.vertices,
        dict(zip(model.joint_names, model.joints(), strict=True)),
    )
    normals = vertex_normals(rest, model.faces)
    names = model.joint_names
    on_arm = np.isin(
        model.weights.argmax(axis=1),
        [
            names.index(f"{s}_{k}")
            for s in ("left", "right")
            for k in ("elbow", "wrist", "shoulder")
        ],
    )
    arm = [joints[f"left_{joint}"] for joint in ("shoulder", "elbow", "wrist")]
    wrist = names.index("left_wrist")
    hand = rest[model.weights[:, wrist] > 0.5].mean(axis=0)
    palm = _PALM / np.linalg.norm(_PALM)
    if what in ("palm", "back of hand"):
        facing = palm if what == "palm" else -palm
        point, chosen = hand + 0.012 * facing, on_arm
    elif what.startswith(("wrist", "forearm")):
        facing = -palm if what.endswith("back") else palm
        along = 0.9 if what.startswith("wrist") else 0.5
        point, chosen = (1 - along) * arm[1] + along * arm[2] + 0.03 * facing, on_arm
    elif what == "upper arm":
        facing = unit_vectors(np.array([0.6, 0.6, 0.5]))
        point, chosen = 0.3 * arm[0] + 0.7 * arm[1] + 0.04 * facing, on_arm
    else:
        point, chosen = np.array(_ON_TRUNK[what or side]), ~on_arm
        facing = normals[np.where(chosen, np.linalg.norm(rest - point, axis=1), 9.0).argmin()]
    point = mirror * (point + rng.normal(0.0, _PLACE_METRES, 3) * (what not in ("palm",)))
    near = np.linalg.norm(rest - point, axis=1) + _FACING_METRES * (
        1.0 - normals @ (mirror * facing)
    )
    near[~chosen] = np.inf
    return np.flatnonzero(near < near.min() + _PATCH_METRES)


def scan_of_touching(model, surface, rng, n_points=20_000, noise=0.001):
    """Return points of a scan without what is inside the body, or where two parts of it touch."""
    scan = rh.registration.simulated_scan(
        surface, model.faces, rng, n_points=3 * n_points, noise=0.0, rotate=False
    )
    corners = rh.surfaces.nearest_points(scan.points, surface, model.faces)[0].triangles
    normals = unit_vectors(
        np.cross(
            *(surface[model.faces[corners, k]] - surface[model.faces[corners, 0]] for k in (1, 2))
        )
    )
    rest = model.template.vertices[model.faces[corners, 0]]
    points = scan.points
    hidden = np.zeros(len(points), dtype=bool)
    near = cKDTree(points).query(points, k=60, distance_upper_bound=_INSIDE_METRES)
    has_neighbour = np.isfinite(near[0])
    others = np.where(has_neighbour, near[1], 0)
    apart = np.linalg.norm(rest[others] - rest[:, None], axis=-1) > _APART_METRES
    apart &= has_neighbour
    # Hidden where other skin is very near, or where the nearest other skin faces away.
    hidden |= (apart & (near[0] < _CONTACT_METRES)).any(axis=1)
    first = apart.argmax(axis=1)
    rows = np.arange(len(points))
    heights = np.einsum(
        "nx,nx->n", points - points[others[rows, first]], normals[others[rows, first]]
    )
    hidden |= apart.any(axis=1) & (heights < 0.0)
    kept = rng.choice(np.flatnonzero(~hidden), min(n_points, int(np.sum(~hidden))), replace=False)
    return points[kept] + noise * rng.standard_normal((len(kept), 3))
