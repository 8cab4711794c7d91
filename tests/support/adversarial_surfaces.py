"""Legal surfaces that rounding does not like, their exact distances, and what rounding may cost.

The condition κ of a set of surfaces is the largest coordinate over the least height of a triangle,
the template's included: a relative error ε of coordinates moves a triangle by εκ of its height.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpmath import mp
from oracles import exact_arc, exact_squared_dist

import riemhuman as rh

EPS = float(np.finfo(np.float64).eps)


@dataclass(frozen=True, eq=False)
class Surfaces:
    """A template and three surfaces over it."""

    family: str
    template: rh.Template
    points: np.ndarray

    def __repr__(self) -> str:
        return f"Surfaces({self.family}, condition {self.condition:.1e})"

    @property
    def space(self) -> rh.AlignedSurfaces:
        """The space of the surfaces."""
        return rh.AlignedSurfaces(self.template, equip=False, scale=None)

    @property
    def legal(self) -> bool:
        """Whether no triangle has an area that is rounding error alone."""
        try:
            self.space.check_immersed(self.points)
        except rh.RiemhumanError:
            return False
        return True

    @property
    def condition(self) -> float:
        """κ of the template and the surfaces."""
        everything = [self.template.vertices, *self.points]
        return max(condition(surface, self.template.faces) for surface in everything)


def heights(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the least height of every triangle."""
    corners = vertices[faces]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1)
    return 2 * areas(vertices, faces) / sides.max(axis=1)


def areas(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the area of every triangle."""
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def condition(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Return the largest coordinate over the least height."""
    return float(np.abs(vertices).max() / heights(vertices, faces).min())


OPEN = [[0, 1, 2], [1, 3, 2], [2, 3, 4]]
FANS = [[0, 1, 2], [1, 0, 3], [0, 1, 4], [4, 1, 5]]  # an edge with three triangles
CLOSED = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]
MESHES = {"one triangle": [[0, 1, 2]], "open": OPEN, "non-manifold": FANS, "closed": CLOSED}
OCTAHEDRON = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 0], [0, 0, -1]])
FAMILIES = (
    *("plain", "slivers", "tiny", "huge", "far", "flat folds", "antipodal", "coincident", "near"),
    *("sliver template", "single precision"),
)


def make(family: str, mesh: str, severity: float, seed: int) -> Surfaces:
    """Return surfaces of a family, as bad as the severity from 0 to 1 says."""
    rng = np.random.default_rng(seed)
    faces = np.array(MESHES[mesh])
    start = OCTAHEDRON[: faces.max() + 1] + rng.uniform(-0.2, 0.2, (faces.max() + 1, 3))
    points = start + rng.uniform(-0.3, 0.3, (3, *start.shape))
    template = start
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    if family in ("slivers", "sliver template"):
        # Everything but lies on a line: heights of 1e-6 of a side.
        squeeze = turn @ np.diag([1.0, 10 ** (-6 * severity), 10 ** (-6 * severity)]) @ turn.T
        if family == "slivers":
            points = points @ squeeze
        else:
            template = template @ squeeze
    elif family == "tiny":
        points, template = 10 ** (-6 * severity) * points, 10 ** (-6 * severity) * template
    elif family == "huge":
        points = 10 ** (6 * severity) * points
    elif family == "far":
        points = points + 10 ** (4 * severity) * turn[0]
    elif family == "flat folds":
        points[..., 2] *= 10 ** (-8 * severity)
        points[..., :2] += rng.uniform(-0.3, 0.3, points[..., :2].shape)
    elif family == "antipodal":
        points[1] = points[0] @ np.diag([1.0, 1.0, 10 ** (-2 - 6 * severity)])
        points[2] = points[1] * np.array([1.0, 1.0, -1.0])
        points[2, :, 0] *= -1.0 if seed % 2 else 1.0
    elif family == "coincident":
        points[1] = points[0]
        points[2] = points[0] + 0.1 * turn[0]
    elif family == "near":
        points = points[0] + 10 ** (-12 * severity) * (points - points[0])
    elif family == "single precision":
        points = points.astype(np.float32).astype(np.float64)
    return Surfaces(f"{family}, {mesh}", rh.Template(template, faces), points)


def draw(rng: np.random.Generator) -> tuple[Surfaces, tuple[float, float, float]]:
    """Return surfaces whose triangles have areas, and weights (a, λ, c)."""
    drawn = make(
        str(rng.choice(FAMILIES)),
        str(rng.choice(list(MESHES))),
        rng.uniform(),
        int(rng.integers(2**16)),
    )
    abc = rng.choice([1e-3, 1.0, 1e3]), 10 ** rng.uniform(-8.0, 4.0), rng.choice([1e-2, 1.0, 1e2])
    return drawn if drawn.legal else make("plain", "open", 0.0, 0), abc


def exact_elastic(surfaces: Surfaces, i: int, j: int, a: float, lam: float, c: float) -> mp.mpf:
    """Return the squared distance with 60 digits."""
    total = mp.mpf(0)
    for face in surfaces.template.faces:
        both = (*surfaces.points[[i, j]], surfaces.template.vertices)
        f, g, t = (edges(points[face]) for points in both)
        if a:
            total += mp.mpf(a) * exact_squared_dist(f.T * f, g.T * g, lam) / 2
        if c:
            total += mp.mpf(c) * exact_area(t) * exact_arc(normal(f), normal(g)) ** 2
    return total


def edges(corners: np.ndarray) -> mp.matrix:
    """Return two edge vectors as columns."""
    p = [mp.matrix([mp.mpf(float(x)) for x in corner]) for corner in corners]
    u, v = p[1] - p[0], p[2] - p[0]
    return mp.matrix([[u[k], v[k]] for k in range(3)])


def normal(e: mp.matrix) -> mp.matrix:
    """Return the cross product of the two columns."""
    (a, d), (b, f), (c, g) = ((e[k, 0], e[k, 1]) for k in range(3))
    return mp.matrix([b * g - c * f, c * d - a * g, a * f - b * d])


def exact_area(e: mp.matrix) -> mp.mpf:
    """Return the area of the triangle of two edge vectors."""
    return mp.norm(normal(e)) / 2


def scale_of_elastic(surfaces: Surfaces, a: float, lam: float, c: float) -> float:
    """Return how far a relative change 1 of all triangles moves a surface, to first order.

    A change η of the edges relative to the heights changes g by 2η g at most in every direction,
    which is √(2 + 4λ) 2η √area in the Ebin metric, but never more than 8 √(λ area), twice the way
    to the apex; and a normal by η.
    """
    faces = surfaces.template.faces
    area = max(float(areas(points, faces).sum()) for points in surfaces.points)
    ebin = 2 * min(np.sqrt(2 + 4 * lam), 4 * np.sqrt(lam) / EPS) * np.sqrt(area)
    return float(np.sqrt(a) * ebin + np.sqrt(c * surfaces.template.face_areas.sum()))
