"""Every metric of the library on adversarial surfaces or their fields, and what is claimed of it.

A subject is one metric with three points and two tangent vectors at the first. Rounding may move
its distances by ε times its condition times its scale, and by a small factor more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from mpmath import mp
from oracles import as_exact, exact_arc, exact_squared_dist
from trust.adversarial_surfaces import (
    EPS,
    Surfaces,
    exact_elastic,
    exact_elastic_product,
    exact_srnf,
    exact_srnf_product,
    exact_traces,
    heights,
    make,
    scale_of_elastic,
    scale_of_srnf,
)

import riemhuman as rh

Weights = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Subject:
    """A metric with points to try it on.

    Attributes
    ----------
    metric : RiemannianMetric
        The metric.
    points : array, shape (3, *shape)
        Points.
    tangent_vecs : array, shape (2, *shape)
        Tangent vectors at the first point, which move no triangle by more than its height.
    condition, scale : float
        Relative errors of ε in what a point is given by move it by ε · condition · scale.
    reach : float
        A part of those tangent vectors along which distances are smooth.
    exact : callable
        Takes i, j to the squared distance of two points with 60 digits.
    exact_product : callable
        Takes two tangent vectors to their inner product at the first point with 60 digits.
    isometries : sequence of callable
        Each takes the subject and a generator to another subject and the ratio of its distances to
        those of this one.
    """

    metric: rh.RiemannianMetric
    points: np.ndarray
    tangent_vecs: np.ndarray
    condition: float
    scale: float
    reach: float
    exact: Callable[[int, int], mp.mpf]
    exact_product: Callable[[np.ndarray, np.ndarray], mp.mpf]
    isometries: Sequence[Callable[..., tuple[Subject, float]]]

    @property
    def rounding(self) -> float:
        """ε · condition · scale."""
        return EPS * self.condition * self.scale


def reach(lam: float) -> float:
    """Return which part of a unit strain turns a point on its cone by less than half a circle."""
    return 0.3 * min(1.0, np.sqrt(lam))


# Surfaces.


def elastic(found: Surfaces, abc: Weights) -> Subject:
    """Return the paper's metric."""
    a, lam, c = abc
    return of_surfaces(
        found,
        lambda space: rh.ElasticMetric(space, a, lam, c),
        scale_of_elastic(found, a, lam, c),
        reach(lam) if a else 0.3,
        lambda i, j: exact_elastic(found, i, j, *abc),
        lambda h, k: exact_elastic_product(found, h, k, *abc),
        (together, relabelled, turned_corners, shifted)
        + ((apart, other_template, scaled) if not c else ())
        + ((resized,) if not a else ()),
    )


def shape(found: Surfaces, abc: Weights) -> Subject:
    """Return the metric of first fundamental forms alone."""
    return elastic(found, (1.0, abc[1], 0.0))


def pose(found: Surfaces, abc: Weights) -> Subject:
    """Return the metric of normals alone."""
    return elastic(found, (0.0, 0.0, 1.0))


def mixed(found: Surfaces, abc: Weights) -> Subject:
    """Return a metric of both."""
    a, lam, c = abc
    return elastic(found, (a or 1.0, lam, c or 1e-2))


def srnf(found: Surfaces, abc: Weights) -> Subject:
    """Return the metric of square root normal fields."""
    return of_surfaces(
        found,
        rh.SRNFMetric,
        scale_of_srnf(found),
        0.3,
        lambda i, j: exact_srnf(found, i, j),
        lambda h, k: exact_srnf_product(found, h, k),
        (together, relabelled, turned_corners, shifted, other_template, scaled),
    )


def of_surfaces(
    found: Surfaces,
    on: Callable[[rh.AlignedSurfaces], rh.RiemannianMetric],
    scale: float,
    smooth: float,
    exact: Callable[[int, int], mp.mpf],
    exact_product: Callable[[np.ndarray, np.ndarray], mp.mpf],
    isometries: Sequence[Callable[..., tuple[Subject, float]]],
) -> Subject:
    """Return a subject whose points are the surfaces themselves."""
    height = heights(found.points[0], found.template.faces).min()
    vectors = np.random.default_rng(0).standard_normal((2, *found.points[0].shape))
    return Subject(
        on(found.space),
        found.points,
        height * vectors,
        found.condition,
        scale,
        smooth,
        exact,
        exact_product,
        tuple(partial(isometry, found, on) for isometry in isometries),
    )


# Fields of surfaces.


def ebin(found: Surfaces, abc: Weights) -> Subject:
    """Return the Ebin metric on the first fundamental forms of the surfaces."""
    lam, areas = abc[1], found.template.face_areas
    space = rh.MetricFields(found.template).equip_with_metric(rh.EbinMetric, lam=lam)
    points = found.space.metric_field(found.points)
    factor = np.linalg.cholesky(points[0])
    noise = np.random.default_rng(0).uniform(-0.5, 0.5, (2, *space.shape))
    vectors = factor @ (noise + np.swapaxes(noise, -1, -2)) @ np.swapaxes(factor, -1, -2)

    def exact(i: int, j: int) -> mp.mpf:
        triples = zip(areas, points[i], points[j], strict=True)
        return sum(mp.mpf(w) * exact_squared_dist(g, h, lam) for w, g, h in triples)

    def exact_product(a: np.ndarray, b: np.ndarray) -> mp.mpf:
        total = mp.mpf(0)
        for w, *matrices in zip(areas, points[0], a, b, strict=True):
            g, p, q = (as_exact(matrix) for matrix in matrices)
            total += mp.mpf(w) * exact_traces(g**-1 * p, g**-1 * q, lam) * mp.sqrt(mp.det(g))
        return total

    return Subject(
        space.metric,
        points,
        space.to_tangent(vectors, points[0]),
        # A rounded entry of g costs a sliver the square of its aspect ratio.
        found.condition**2,
        scale_of_elastic(found, 1.0, lam, 0.0),
        reach(lam),
        exact,
        exact_product,
        (other_frames, larger_matrices),
    )


def normals(found: Surfaces, abc: Weights) -> Subject:
    """Return the metric of normal fields on the normals of the surfaces."""
    space, areas = rh.NormalFields(found.template), found.template.face_areas
    points = found.space.normal_field(found.points)
    vectors = np.random.default_rng(0).standard_normal((2, *space.shape))

    def exact(i: int, j: int) -> mp.mpf:
        triples = zip(areas, points[i], points[j], strict=True)
        return sum(mp.mpf(w) * exact_arc(n, m) ** 2 for w, n, m in triples)

    def exact_product(v: np.ndarray, w: np.ndarray) -> mp.mpf:
        terms = zip(np.repeat(areas, 3), v.ravel(), w.ravel(), strict=True)
        return sum(mp.mpf(area) * mp.mpf(x) * mp.mpf(y) for area, x, y in terms)

    return Subject(
        space.metric,
        points,
        space.to_tangent(vectors, points[0]),
        1.0,
        float(np.sqrt(areas.sum())),
        0.3,
        exact,
        exact_product,
        (turned_vectors,),
    )


# Isometries.


def rotation(rng: np.random.Generator) -> np.ndarray:
    """Return a random rotation."""
    turn, triangle = np.linalg.qr(rng.standard_normal((3, 3)))
    turn = turn * np.sign(np.diag(triangle))
    return turn * np.sign(np.linalg.det(turn))


def together(found, on, subject, rng):
    """Turn and mirror all surfaces alike."""
    turn = rotation(rng) * rng.choice([-1.0, 1.0])
    return replace(subject, points=subject.points @ turn.T), 1.0


def shifted(found, on, subject, rng):
    """Shift each surface by itself, as far as its coordinates reach."""
    shifts = np.abs(subject.points).max() * rng.uniform(-1, 1, (3, 1, 3))
    return replace(subject, points=subject.points + shifts), 1.0


def apart(found, on, subject, rng):
    """Turn each surface by itself."""
    turns = np.stack([rotation(rng) for _ in subject.points])
    return replace(subject, points=subject.points @ turns), 1.0


def relabelled(found, on, subject, rng):
    """Number the vertices and the triangles otherwise."""
    order = rng.permutation(len(found.template.vertices))
    faces = np.argsort(order)[rng.permutation(found.template.faces)]
    space = rh.AlignedSurfaces(
        rh.Template(found.template.vertices[order], faces), equip=False, scale=None
    )
    return replace(subject, metric=on(space), points=subject.points[:, order]), 1.0


def turned_corners(found, on, subject, rng):
    """Begin triangles at another corner, and turn all of them inside out."""
    faces = [np.roll(face, rng.integers(3))[::-1] for face in found.template.faces]
    space = rh.AlignedSurfaces(rh.Template(found.template.vertices, faces), equip=False, scale=None)
    return replace(subject, metric=on(space)), 1.0


def other_template(found, on, subject, rng):
    """Take one of the surfaces for the template."""
    template = rh.Template(found.points[rng.integers(3)], found.template.faces)
    return replace(subject, metric=on(rh.AlignedSurfaces(template, equip=False, scale=None))), 1.0


def scaled(found, on, subject, rng):
    """Scale all surfaces, which scales their distances."""
    factor = 10.0 ** rng.uniform(-6, 6)
    scale = factor * subject.scale
    return replace(subject, points=factor * subject.points, scale=scale), factor


def resized(found, on, subject, rng):
    """Scale each surface by itself, which normals do not see."""
    factors = 10.0 ** rng.uniform(-6, 6, (3, 1, 1))
    return replace(subject, points=factors * subject.points), 1.0


def other_frames(subject, rng):
    """Exchange and reflect the axes of each triangle."""
    n_faces = subject.points.shape[1]
    frames = np.eye(2)[rng.permuted(np.tile([0, 1], (n_faces, 1)), axis=1)]
    frames = frames * rng.choice([-1.0, 1.0], (n_faces, 1, 2))
    return replace(subject, points=np.swapaxes(frames, 1, 2) @ subject.points @ frames), 1.0


def larger_matrices(subject, rng):
    """Scale all matrices, which scales distances by the root."""
    factor = 4.0 ** int(rng.integers(-20, 21))
    scale = np.sqrt(factor) * subject.scale
    return replace(subject, points=factor * subject.points, scale=scale), np.sqrt(factor)


def turned_vectors(subject, rng):
    """Turn and mirror all vectors alike."""
    turn = rotation(rng) * rng.choice([-1.0, 1.0])
    return replace(subject, points=subject.points @ turn.T), 1.0


METRICS = {
    "shape": shape,
    "pose": pose,
    "mixed": mixed,
    "SRNF": srnf,
    "Ebin": ebin,
    "normals": normals,
}
"""Makers of subjects by name, each taking surfaces and weights (a, λ, c)."""
FIELDS = ("Ebin", "normals")
"""The metrics on fields, whose geodesics have a closed form."""


def subject_of(name: str, found: Surfaces, abc: Weights, smooth: bool = False) -> Subject:
    """Return a subject; plain surfaces stand in where rounding has made a matrix degenerate.

    Smooth ones keep the digits that derivatives of second order are seen by: λ is at least 0.01,
    and plain surfaces stand in for conditions above 1000.
    """
    plain = make("plain", "open", 0.0, 0)
    if name == "Ebin":
        space = rh.MetricFields(found.template)
        if not space.belongs(found.space.metric_field(found.points)).all():
            found = plain
    if smooth:
        abc = (abc[0], max(abc[1], 0.01), abc[2])
        if METRICS[name](found, abc).condition > 1e3:
            found = plain
    return METRICS[name](found, abc)
