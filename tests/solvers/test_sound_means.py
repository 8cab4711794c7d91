"""Means that are bodies: lengths as people have them, and no triangle that shrinks away unsaid."""

import bodies_in_motion as bodies
import numpy as np
import pytest
from cases import triangle_template

from riemhuman.datasets import load_open_bodies
from riemhuman.errors import ArgumentError, DegenerateSurfaceError, UnseenLengthsWarning
from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
from riemhuman.geometry.elastic_metric import ElasticMetric
from riemhuman.geometry.rotation_metric import RotationMetric
from riemhuman.solvers import BasisMean
from riemhuman.solvers.dispersion import Dispersion
from riemhuman.solvers.sound_means import AreaCheck
from riemhuman.surfaces.distortion import edge_lengths


def edge_range(companion_weight, weights=None):
    """Return how far edges of a pose mean leave the range of the ten poses, as ratios."""
    data = load_open_bodies("coarse")
    points, metric = data.points[:10], ElasticMetric(bodies.space(), 0.0, 0.0, 1.0)
    solver = BasisMean(bodies.basis(), companion_weight=companion_weight, max_iter=200)
    found = solver.solve(metric, points)
    assert found.variance == pytest.approx(Dispersion(metric, points).value(found.point))
    edges = data.template.edges
    given, own = edge_lengths(points, edges), edge_lengths(found.point, edges)
    return (own / given.min(axis=0)).min(), (own / given.max(axis=0)).max()


def test_arms_of_a_pose_mean_are_no_rubber():
    shortest, longest = edge_range(1.0)
    assert shortest > 0.8
    assert longest < 1.15


def test_a_metric_of_normals_alone_sees_no_lengths():
    with pytest.warns(UnseenLengthsWarning, match=r"c=1.0\) does not see the lengths of edges"):
        shortest, _ = edge_range(0.0)
    assert shortest < 0.75


def test_a_mean_by_rotations_alone_warns_too():
    points = load_open_bodies("coarse").points[:2]
    with pytest.warns(UnseenLengthsWarning, match=r"RotationMetric"):
        BasisMean(tolerance=0.5).solve(RotationMetric(bodies.space()), points)


def test_triangles_that_shrink_away_are_said():
    """Of fifteen unlike bodies under the space's own metric, whose λ is 1e-4."""
    points = load_open_bodies("coarse").points[::7]
    metric = ElasticMetric(bodies.space(), 1.0, 1e-4, 0.0)
    seen = []
    solver = BasisMean(bodies.basis(), callback=lambda *state: seen.append(state))
    with pytest.raises(DegenerateSurfaceError, match=r"use lam = 1, or a medoid"):
        solver.solve(metric, points)
    assert len(seen) < 10


def test_a_triangle_has_collapsed_below_a_hundredth_of_its_median_area():
    space = AlignedSurfaces(triangle_template(), equip=False)
    flat = space.template.vertices
    check = AreaCheck(space, np.stack([flat, 2.0 * flat, 3.0 * flat]))
    check.refuse_collapse(0.2 * np.sqrt(1.02) * flat)
    with pytest.raises(DegenerateSurfaceError, match="1 of 1 triangles"):
        check.refuse_collapse(0.2 * np.sqrt(0.98) * flat)


def test_bad_input():
    with pytest.raises(ArgumentError, match="companion_weight must be"):
        BasisMean(companion_weight=-1.0)
