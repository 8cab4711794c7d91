"""The open bodies: ten people in ten poses, plain or natural, from the open body model.

Natural bodies have traits of real people that the model lacks: habits, self-contact, soft tissue.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from riemhuman.arrays import Array
from riemhuman.bodies import BodyModel
from riemhuman.bodies.open_model import load_open_model
from riemhuman.checks import one_of, whole_number
from riemhuman.datasets._natural_bodies import natural_surfaces, reach, surface_noise
from riemhuman.datasets.bodies import Bodies
from riemhuman.datasets.open_poses import Angles, joint_rotations, pose_vectors, read_table
from riemhuman.kernels.threads import single_threaded_libraries

_VARIANTS = ("plain", "natural")

# Standard deviations of a performance from the defined pose, degrees: of the joints of trunk and
# head, and of the joints of both sides.
_TRUNK = {"pelvis": 1.5, "spine": 1.0, "chest": 1.0, "neck": 2.0, "head": 2.0}
_ARM = {"collar": 1.0, "shoulder": 3.0, "elbow": 3.0, "wrist": 4.0}
_DEGREES = _TRUNK | _ARM | {"hip": 2.0, "knee": 2.0, "ankle": 2.0, "toes": 1.0}
_HEADING_DEGREES = 2.0
_PLACE_METRES = 0.02
_NOISE_METRES = 0.002
_WAVELENGTHS = (0.25, 0.8)
_SEED = 2022
_EXTREME = 2.0  # largest standard deviations of random people

# Standard deviations of joints that differ from those of the plain bodies, degrees.
_NATURAL_DEGREES = _DEGREES | {"head": 2.5, "shoulder": 2.5, "elbow": 4.0, "wrist": 5.0, "hip": 1.5}
# The share of this variance that is a habit, the same in all poses of a person.
_HABIT = 0.5
_TOUCHED_POINT_METRES = 0.019


def load_open_bodies(
    resolution: str = "full", variant: str = "plain", people: int | None = None
) -> Bodies:
    """Return ten adults in ten poses: 100 registered surfaces.

    The bodies are five women and five men with different body shapes, in poses similar to those of
    FAUST. Performances differ from the defined poses by a few degrees per joint, by heading and
    place, and by smooth noise of millimetres. Surface ``i`` shows subject ``i // 10`` in pose ``i %
    10``. All calls return the same surfaces, and both resolutions show the same performances. They
    come with their model, betas, pose vectors and translations.

    The plain bodies are those of the body model with noise. The natural bodies have properties that
    make real registered bodies harder: people differ in how they hold a pose (hands by about 6 cm),
    two poses differ only by a tilted head, hands rest on hips and head, and each person has
    individual surface detail and soft tissue, which the shape coefficients do not describe.

    Parameters
    ----------
    resolution : {"full", "coarse"}
        See `load_open_model`.
    variant : {"plain", "natural"}
    people : int, optional
        Seed for ten other people with other performances, for testing methods that were tuned on
        the default ten. The default ten are the same in both variants.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> bodies.points.shape, bodies.pose_names[bodies.pose[3]]
    ((100, 1202, 3), 'bent_elbows')
    """
    model = load_open_model(resolution)
    natural = one_of(variant, "variant", _VARIANTS) == "natural"
    table = read_table("open_poses")
    default_shapes = np.array(list(table["people"].values()))
    if people is None:
        rng = np.random.default_rng(_SEED)
        names = tuple(table["people"])
        shapes = default_shapes
    else:
        rng = np.random.default_rng([_SEED, whole_number(people, "people", minimum=0)])
        names = tuple(f"person {number} of {people}" for number in range(len(default_shapes)))
        shapes = np.clip(rng.standard_normal(default_shapes.shape), -_EXTREME, _EXTREME)
    angles = table[variant]

    # Joints of the two models differ by millimetres, but performances must be the same.
    coarse = load_open_model("coarse")
    if natural:
        poses = _performances(coarse, angles, shapes, rng, table["touched"])
    else:
        poses = _performances(model, angles, shapes, rng)
    n_poses = poses.shape[1]
    betas = np.repeat(shapes[:, None], n_poses, axis=1)
    places = rng.normal(0.0, _PLACE_METRES, (len(shapes), n_poses, 3))
    places[..., 1] = _height_above_ground(model, betas, poses)

    points = np.empty((len(shapes), n_poses, model.n_vertices, 3))
    with single_threaded_libraries():  # because products are small
        for subject, shape in enumerate(shapes):  # one at a time, to save memory
            if natural:
                surfaces = natural_surfaces(model, coarse.joints(), shape, poses[subject], rng)
            else:
                surfaces = model(betas[subject], poses[subject])
            surfaces = surfaces + places[subject, :, None]
            noise = [
                surface_noise(model.template.vertices, _NOISE_METRES, _WAVELENGTHS, rng)
                for _ in range(n_poses)
            ]
            points[subject] = surfaces + np.stack(noise)

    return Bodies(
        points=points.reshape(-1, model.n_vertices, 3),
        subject=np.repeat(np.arange(len(shapes)), n_poses),
        pose=np.tile(np.arange(n_poses), len(shapes)),
        template=model.template,
        model=model,
        subject_names=names,
        pose_names=tuple(angles),
        betas=betas.reshape(-1, model.n_betas),
        pose_vectors=poses.reshape(-1, model.n_joints, 3),
        translations=places.reshape(-1, 3),
    )


def _performances(
    model: BodyModel,
    angles: Mapping[str, Mapping[str, Angles]],
    betas: Array,
    rng: np.random.Generator,
    touched: Mapping[str, Mapping[str, Array]] | None = None,
) -> Array:
    """Return pose vectors (people, poses, J, 3), natural ones if hands touch the body."""
    shape = (len(betas), len(angles), model.n_joints, 3)
    if touched is None:
        degrees = _DEGREES
        offsets = rng.standard_normal(shape)
    else:
        degrees = _NATURAL_DEGREES
        habits = rng.standard_normal((len(betas), 1, *shape[2:]))
        offsets = np.sqrt(_HABIT) * habits + np.sqrt(1.0 - _HABIT) * rng.standard_normal(shape)
    offsets *= np.array([[degrees[name.split("_")[-1]]] for name in model.joint_names])
    if touched is None:
        offsets[..., model.parents < 0, 1] += rng.normal(0.0, _HEADING_DEGREES, (*shape[:2], 1))
    defined = np.stack([joint_rotations(pose_angles, model) for pose_angles in angles.values()])
    turned = Rotation.from_rotvec(offsets.reshape(-1, 3), degrees=True).as_matrix()
    poses = pose_vectors(turned.reshape(*shape, 3) @ defined, model)
    for name, points in (touched or {}).items():
        number = list(angles).index(name)
        for side, point in points.items():
            touched_points = point + rng.normal(0.0, _TOUCHED_POINT_METRES, (len(betas), 3))
            poses[:, number] = reach(model, betas, poses[:, number], side, touched_points)
    return poses


def _height_above_ground(model: BodyModel, betas: Array, poses: Array) -> Array:
    """Return the upward shift that puts the lower foot at its height in the rest pose."""
    feet = [name.endswith(("ankle", "toes")) for name in model.joint_names]
    rest, posed = model.joints(betas), model.joints(betas, poses)
    heights: Array = (rest - posed)[..., feet, 1].max(axis=-1)
    return heights
