"""The compiled loops agree with the differentiable definitions, and their series with mpmath."""

from functools import partial

import numpy as np
import pytest
from autograd import value_and_grad
from cases import CASES, SURFACES, TEMPLATES, name_of, sphere_template, surfaces

from riemhuman.geometry import (
    AlignedSurfaces,
    ElasticMetric,
    RiemannianMetric,
    SRNFMetric,
    SurfaceMetric,
)
from riemhuman.kernels import surface
from riemhuman.kernels.threads import of_one_kind
from riemhuman.surfaces import Template
from riemhuman.terms import EbinTerm, FlatTerm, NormalTerm, RootNormalTerm, _drivers
from riemhuman.terms._drivers import SumOfTerms

COMPILED = [case for case in SURFACES if isinstance(case.metric, SurfaceMetric)]


def check_against_definition(metric, path, rtol=1e-10):
    energy, gradient = metric.energy_and_gradient(path)
    expected, expected_gradient = value_and_grad(partial(RiemannianMetric.energy, metric))(path)
    np.testing.assert_allclose(energy, expected, rtol=rtol)
    scale = np.abs(expected_gradient).max()
    np.testing.assert_allclose(gradient, expected_gradient, rtol=0, atol=rtol * scale)


@pytest.mark.parametrize("size", [1e-5, 1e-3, 0.03, 0.3, 3.0])
@pytest.mark.parametrize("case", COMPILED, ids=name_of)
def test_compiled_energy_agrees_at_all_distances(case, size):
    template = case.space.template
    path = surfaces(template, 5, rng=12, size=size)
    if size == 1e-5:
        # Rounding in the differences of near-equal surfaces is all that differs.
        check_against_definition(case.metric, path, rtol=1e-8)
    else:
        check_against_definition(case.metric, path)


def test_checker_sees_a_broken_twin():
    class OtherWeight(NormalTerm):
        def add_segments(self, records, slopes, areas):
            return super().add_segments(records, slopes, of_one_kind(areas * (1 + 1e-9)))

    case = CASES["all sphere"]
    metric = SurfaceMetric(case.space, [EbinTerm(1.0, 1.0), OtherWeight(1.0)])
    with pytest.raises(AssertionError):
        check_against_definition(metric, case.points)


# Triangles without area.


def collapsed_path(template):
    """Return a path with a triangle shrunk to an edge, and one shrunk to a point."""
    path = surfaces(template, 4, rng=13)
    faces = template.faces
    path[2, faces[3, 1]] = path[2, faces[3, 0]]
    path[3, faces[5]] = path[3, faces[5, 0]]
    return path


@pytest.mark.parametrize("template_name", ["sphere", "open"])
def test_degenerate_triangles(template_name):
    template = TEMPLATES[template_name]()
    space = AlignedSurfaces(template, equip=False)
    path = collapsed_path(template)
    for metric in (ElasticMetric(space, 1.0, 0.3, 0.0), SRNFMetric(space)):
        check_against_definition(metric, path)
    energy, gradient = ElasticMetric(space, 1.0, 0.3, 0.2).energy_and_gradient(path)
    assert energy == np.inf
    assert np.all(np.isfinite(gradient))


@pytest.mark.parametrize("share", [0.99, 1.01], ids=["below", "above"])
def test_how_thin_a_triangle_may_be(share):
    """Whatever the lengths of its sides: the sine of the angle between them counts."""
    for along, across in ((1e-3, 1e3), (1e3, 1e-3), (30.0, 20.0)):
        height = across * share * np.sqrt(surface.DEGENERATE)
        *_, area = _drivers.first_forms.py_func(along, 0.0, 0.0, across, height, 0.0)
        assert area == pytest.approx(along * height if share > 1 else 0.0, rel=1e-12)


@pytest.mark.parametrize("at", [0.0, 0.4, 1.0], ids=str)
def test_nearly_degenerate_triangles_are_those_of_the_definition(at):
    template = TEMPLATES["open"]()
    path = surfaces(template, 3, rng=3)
    one, two, three = template.faces[5]
    path[1, three] = (1 - at) * path[1, one] + at * path[1, two]
    marked = _drivers.nearly_degenerate(path, template)
    assert marked[1, 5]
    derivatives = surface.partial_derivatives(path, template.differential_operator)
    np.testing.assert_array_equal(marked, surface.is_degenerate(*derivatives))


class Uncompiled(FlatTerm):
    """A term that runs by its definition."""

    def field(self, first):
        return first.area_vectors


LONG_TERMS = [EbinTerm(1.0, 0.3), NormalTerm(0.2), RootNormalTerm(0.7), Uncompiled(0.4)]


def test_long_paths_are_the_sum_of_their_parts():
    """They run in threads, a few triangles after the others; short paths run in one pass."""
    template, n_parts = TEMPLATES["sphere"](), 100
    driver, path = SumOfTerms(LONG_TERMS, template), surfaces(template, 12 * n_parts + 1, rng=3)
    energy, gradient = driver.path_energy(path)
    total, slopes = 0.0, np.zeros_like(path)
    for first in range(0, 12 * n_parts, 12):
        part = slice(first, first + 13)
        energy_of_part, slopes_of_part = driver.path_energy(path[part])
        total += n_parts * energy_of_part
        slopes[part] += n_parts * slopes_of_part
    np.testing.assert_allclose(energy, total, rtol=1e-12)
    np.testing.assert_allclose(gradient, slopes, rtol=0, atol=1e-12 * np.abs(slopes).max())
    assert driver.path_energy(path, gradient=False)[0] == pytest.approx(energy, rel=1e-14)


def test_distances_on_large_meshes_are_the_sum_over_their_parts():
    """They run in threads, in one pass over the triangles after the other; each part in one."""
    whole, weights = sphere_template(5), np.array([0.2, 1.3, 0.7])
    f, *others = surfaces(whole, 4, rng=3)
    squared, gradient = SumOfTerms(LONG_TERMS, whole).squared_dists(f, others, weights)
    total, slopes = np.zeros(3), np.zeros_like(f)
    for first in range(0, whole.n_faces, 4096):
        part = Template(whole.vertices, whole.faces[first : first + 4096])
        squared_of_part, slope = SumOfTerms(LONG_TERMS, part).squared_dists(f, others, weights)
        total += squared_of_part
        slopes += slope
    np.testing.assert_allclose(squared, total, rtol=1e-12)
    np.testing.assert_allclose(gradient, slopes, rtol=0, atol=1e-12 * np.abs(slopes).max())


def test_distances_from_one_surface_are_energies_of_single_steps():
    """Of surfaces whose vertices are numbered in another order, too."""
    template = TEMPLATES["sphere"]()
    driver = SumOfTerms([EbinTerm(1.0, 0.3), NormalTerm(0.2), Uncompiled(0.4)], template)
    f, *others = surfaces(template, 4, rng=3)
    weights = np.array([0.2, 1.3, 0.7])
    steps = [driver.path_energy(np.stack([other, f])) for other in others]
    expected = np.tensordot(weights, [slope[1] for _, slope in steps], 1)
    order = np.random.default_rng(4).permutation(template.n_vertices)
    for points, faces in (
        (np.stack(others), None),
        (np.stack(others)[:, order], np.argsort(order)[template.faces]),
    ):
        squared, gradient = driver.squared_dists(f, points, weights, faces)
        np.testing.assert_allclose(squared, [energy for energy, _ in steps], rtol=1e-12)
        np.testing.assert_allclose(gradient, expected, atol=1e-12)
