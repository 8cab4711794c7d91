"""People whom the body model cannot make, and whose flesh moves with the pose in ways it lacks.

They stand in for real people where none may be stored.
"""

from dataclasses import dataclass

import numpy as np
from open_bodies import model_with
from scanned_people import foreign_shape

import riemhuman as rh
from riemhuman.datasets.open_bodies import surface_noise

# How far from a joint flesh moves with it, and displacements a radian at strength 1, metres.
_REACH, _A_RADIAN = 0.16, 0.02
_LARGEST_BEND = 1.6
# Share of the fields of flesh that all people have in common.
_COMMON = 0.7
_N_POSES = 10


@dataclass(frozen=True, eq=False)
class PeopleWhoseFleshMoves:
    """Ten poses of several people; and each person in the standard pose, whose flesh is at rest."""

    points: np.ndarray
    subject: np.ndarray
    at_rest: np.ndarray


def people_whose_flesh_moves(seed, n_people, strength, *, waves=0.002, waist=0.0):
    """Return people; `waves` are displacements in metres that differ in every pose.

    `waist` is by how much the girth of everybody's waist has grown, metres.
    """
    model = rh.datasets.load_open_model("coarse")
    rest, joints = model.template.vertices, model.joints()
    standard = rh.measurements.open_measurements("coarse").standard_pose_vector
    natural = rh.datasets.load_open_bodies("coarse", "natural", 1000 + seed)
    rng = np.random.default_rng([seed, 6890])

    def flesh(generator):
        fields = np.empty((len(joints), 3, *rest.shape))
        for joint in range(len(joints)):
            near = np.exp(-np.sum(((rest - joints[joint]) / _REACH) ** 2, axis=1))
            for axis in range(3):
                noise = surface_noise(rest, 1.0, (0.15, 0.4), generator)
                fields[joint, axis] = near[:, None] / near.max() * noise
        return fields

    shared = flesh(np.random.default_rng(99))
    points, at_rest = [], []
    for person in range(n_people):
        body = foreign_shape(model, rng) + _growth_of_waist(model, waist)
        fields = _COMMON * shared + np.sqrt(1.0 - _COMMON**2) * flesh(rng)
        at_rest.append(model_with(model, v_template=body)(pose=standard))
        for pose in natural.pose_vectors[_N_POSES * person : _N_POSES * (person + 1)]:
            bends = np.clip(pose, -_LARGEST_BEND, _LARGEST_BEND)
            bends[0] = 0.0
            moved = strength * _A_RADIAN * np.einsum("ja,javx->vx", bends, fields)
            moved += surface_noise(rest, waves, (0.2, 0.6), rng)
            points.append(model_with(model, v_template=body + moved)(pose=pose))
    subject = np.repeat(np.arange(n_people), _N_POSES)
    return PeopleWhoseFleshMoves(np.array(points), subject, np.array(at_rest))


def _growth_of_waist(model, girth):
    """Return displacements of the trunk around the navel, outward on the level."""
    rest, names = model.template.vertices, list(model.joint_names)
    landmarks = rh.measurements.open_measurements("coarse").landmarks
    sides = [landmarks[f"{side}_omphalion"] for side in ("left", "right")]
    navel = np.mean([weights @ rest[vertices] for vertices, weights in sides], axis=0)
    arms = [k for k, name in enumerate(names) if name.endswith(("shoulder", "elbow", "wrist"))]
    on_trunk = 1.0 - model.weights[:, arms].sum(axis=1)
    on_trunk[model.weights[:, arms].any(axis=1)] = 0.0
    outward = (rest - navel) * [1.0, 0.0, 1.0]
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    near = np.exp(-(((rest - navel)[:, 1] / 0.12) ** 2))
    return girth / (2.0 * np.pi) * (on_trunk * near)[:, None] * outward
