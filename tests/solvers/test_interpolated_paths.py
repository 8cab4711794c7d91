"""Paths interpolated without a search: triangles that rotate, and parameters of a body model."""

import bodies_in_motion
import numpy as np
import pytest
from cases import sphere_template

from riemhuman.errors import ArgumentError, ArgumentTypeError, DegenerateSurfaceError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.solvers import ModelParameters, ModelPath, PoissonPath, SegmentEnergy
from riemhuman.solvers.interpolated_paths import rotating_paths


@pytest.mark.parametrize("seed", [1, 2, 14])
def test_the_best_turned_path_and_its_rivals(seed):
    """Every part of the body turns the way that costs less; rivals turn a whole limb the other."""
    metric = ElasticMetric(bodies_in_motion.space(), 0.0, 0.0, 1.0)
    start, end = bodies_in_motion.swung_arms(seed)
    found = rotating_paths(metric, SegmentEnergy(), start, end, 11)
    energies = [rival.energy for rival in found]
    interpolator = metric.space.template.interpolator
    shorter = interpolator.rotations(start, end)
    alike = interpolator.unwrap(shorter)
    for turns in (shorter, alike):
        between = interpolator.interpolate(start, end, np.linspace(0, 1, 11)[1:-1], turns)
        assert energies[0] <= metric.energy(np.stack([start, *between, end]))
    for path, energy, _ in found:
        np.testing.assert_array_equal(path[[0, -1]], [start, end])
        assert energies[0] <= energy <= 1.1 * energies[0]
        assert energy == pytest.approx(metric.energy(path), rel=1e-12)


def test_small_parts_together_have_no_rival():
    """One limb, and some triangles: only the limb is tried both ways."""
    metric = ElasticMetric(bodies_in_motion.space(), 0.0, 0.0, 1.0)
    start, end = bodies_in_motion.swung_arms(7)
    best, rival = rotating_paths(metric, SegmentEnergy(), start, end, 5)
    assert len(best.follows) == 2
    assert best.follows[0] != rival.follows[0]
    assert best.follows[1] == rival.follows[1]


def test_a_triangle_without_area_has_no_rotation():
    template = sphere_template()
    metric = ElasticMetric(AlignedSurfaces(template, equip=False), 1.0, 1.0, 0.0)
    flat = template.vertices.copy()
    flat[template.faces[3]] = flat[template.faces[3, 0]]
    with pytest.raises(DegenerateSurfaceError, match="end"):
        PoissonPath(5).solve(metric, template.vertices, flat)


@pytest.fixture(scope="module")
def metric():
    return ElasticMetric(bodies_in_motion.space(), a=1.0, lam=1.0, c=1.0)


def parameters(rng, turn=1.0):
    rng = np.random.default_rng(rng)
    model = bodies_in_motion.model()
    return ModelParameters(
        rng.normal(size=model.n_betas),
        rng.normal(0.0, turn, (model.n_joints, 3)),
        rng.normal(size=3),
    )


def given(*parameters):
    """Return a function that gives the parameters of the start and of the end in turn."""
    in_turn = iter(parameters)
    return lambda surface: next(in_turn)


def solve(metric, first, last, **settings):
    model = bodies_in_motion.model()
    solver = ModelPath(model, parameters=given(first, last), **settings)
    return solver.solve(metric, model(*first[:3]), model(*last[:3]))


def test_axis_angle_vectors_are_interpolated_linearly(metric):
    model, first, last = bodies_in_motion.model(), parameters(1, 0.3), parameters(2, 0.3)
    result = solve(metric, first, last, n_nodes=5)
    for path_time, surface in zip(np.linspace(0, 1, 5), result.path, strict=True):
        mixed = [(1 - path_time) * a + path_time * b for a, b in zip(first, last, strict=True)]
        np.testing.assert_allclose(surface, model(*mixed), atol=1e-12)
    assert result.energy == metric.energy(result.path)
    assert result.converged


def test_message_says_how_far_the_surfaces_are(metric):
    model, first, last = bodies_in_motion.model(), parameters(1, 0.2), parameters(2, 0.2)
    shifted = model(*last)
    shifted[7] += [0.003, 0.0, 0.004]
    solver = ModelPath(model, n_nodes=3, parameters=given(first, last))
    result = solver.solve(metric, model(*first), shifted)
    assert "up to 5 mm from start and end" in result.message


@pytest.mark.everyday
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"pose": np.full((3, 3), np.nan)}, r"pose of parameters\(end\) holds 9 NaN"),
        ({"trans": np.zeros((1, 3))}, r"trans of parameters\(end\) must have shape"),
    ],
)
def test_malformed_parameters_are_refused(metric, change, message):
    good, surface = parameters(1), bodies_in_motion.body("resting")
    both = given(good, good._replace(**change))
    with pytest.raises((ArgumentError, ArgumentTypeError), match=message):
        ModelPath(bodies_in_motion.model(), parameters=both).solve(metric, surface, surface)


def test_models_of_another_template_are_refused(metric):
    surface, values = bodies_in_motion.body("resting"), parameters(1)

    def model(betas, pose, trans):
        return np.zeros((len(pose), 4, 3))

    with pytest.raises(ArgumentError, match="the model's surfaces must have shape"):
        ModelPath(model, parameters=given(values, values)).solve(metric, surface, surface)
