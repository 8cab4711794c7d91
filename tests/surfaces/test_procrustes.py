"""Alignment: rotations, translations, scales, units and axes."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from riemhuman.errors import ArgumentError, ConvergenceWarning
from riemhuman.surfaces.procrustes import AXES, generalized_procrustes, make_upright, procrustes

N_SURFACES, N_VERTICES = 6, 60


@pytest.fixture
def rng():
    return np.random.default_rng(7)


@pytest.fixture
def reference(rng):
    return rng.normal(size=(N_VERTICES, 3)) * [0.3, 1.0, 0.2] + [1.0, -2.0, 0.5]


def moved(surface, rng, *, noise=0.0, scale=False, n=N_SURFACES):
    """Return n copies of a surface, each turned, shifted, roughened and perhaps scaled."""
    turned = np.einsum("nij,vj->nvi", Rotation.random(n, rng=rng).as_matrix(), surface)
    turned += rng.normal(scale=noise, size=turned.shape)
    factors = rng.uniform(0.3, 3.0, size=(n, 1, 1)) if scale else 1.0
    return factors * turned + rng.normal(size=(n, 1, 3))


@pytest.mark.parametrize("mirror", [1.0, -1.0])
@pytest.mark.parametrize("scale", [False, True])
def test_no_nearby_motion_fits_better(reference, rng, scale, mirror):
    weights = rng.uniform(0, 1, size=N_VERTICES)
    points = moved(reference * [mirror, 1.0, 1.0], rng, noise=0.3, scale=True)
    found = procrustes(points.reshape(2, 3, N_VERTICES, 3), to=reference, scale=scale or None,
                       weights=weights)  # fmt: skip
    aligned = found[0, 0]

    def misfit(motion):
        turned = Rotation.from_rotvec(motion[:3]).apply(aligned) * np.exp(scale * motion[6])
        return weights @ np.sum((turned + motion[3:6] - reference) ** 2, axis=1)

    best = minimize(misfit, np.zeros(7), method="BFGS").fun
    assert misfit(np.zeros(7)) <= best * (1 + 1e-9)


@pytest.mark.parametrize("offset", [1e3, 1e6])
def test_far_from_the_origin(reference, offset):
    aligned = procrustes(reference + offset, to=reference)
    np.testing.assert_allclose(aligned, reference, atol=1e-15 * offset + 1e-14)


@pytest.mark.parametrize("scale", [False, True])
def test_generalized_undoes_any_motion(reference, rng, scale):
    points = moved(reference, rng, scale=scale)
    aligned, mean = generalized_procrustes(points, scale=scale)
    np.testing.assert_allclose(aligned, np.broadcast_to(mean, aligned.shape), atol=1e-13)


@pytest.mark.parametrize("scale", [False, True])
def test_generalized_mean_is_at_rest(reference, rng, scale):
    points = moved(reference, rng, noise=0.2, scale=scale).reshape(3, 2, N_VERTICES, 3)
    weights = rng.uniform(0, 1, size=N_VERTICES)
    aligned, mean = generalized_procrustes(points, scale=scale, weights=weights)
    np.testing.assert_allclose(
        aligned, procrustes(points, to=mean, scale=scale, weights=weights), atol=1e-12
    )
    # With scale, the mean of the aligned surfaces is the mean up to its size.
    average = procrustes(aligned.mean(axis=(0, 1)), to=mean, scale=scale, weights=weights)
    np.testing.assert_allclose(average, mean, atol=1e-9)


def test_generalized_keeps_the_size_of_the_surfaces(reference, rng):
    points = moved(reference, rng, noise=0.1, scale=True)
    _, mean = generalized_procrustes(points, scale=True)
    sizes = np.sum((points - points.mean(axis=1, keepdims=True)) ** 2, axis=(1, 2))
    np.testing.assert_allclose(np.sum((mean - mean.mean(axis=0)) ** 2), sizes.mean(), rtol=1e-12)


def test_stopping_early_is_said(reference, rng):
    points = moved(reference, rng, noise=0.5)
    with pytest.warns(ConvergenceWarning, match="stopped after 2 iterations"):
        generalized_procrustes(points, max_iter=2)


LINE = np.outer(np.linspace(-0.3, 1.1, N_VERTICES), [0.1, 0.2, 0.7])


@pytest.mark.parametrize(("length", "offset"), [(1.0, 3.3), (1e-3, 1e4), (1e6, 1.0)])
@pytest.mark.parametrize("scale", [None, True])
def test_points_on_a_line_are_refused(reference, length, offset, scale):
    line = length * LINE + offset
    with pytest.raises(ArgumentError, match=r"points has no single best alignment"):
        procrustes(line, to=reference, scale=scale)
    with pytest.raises(ArgumentError, match=r"points\[0\] has no single best alignment"):
        procrustes([reference, reference], to=line, scale=scale)
    with pytest.raises(ArgumentError, match=r"points\[1, 0\] has no single best alignment"):
        procrustes([[reference], [line]], to=reference, scale=scale)
    with pytest.raises(ArgumentError, match=r"points\[0\] has no single best alignment"):
        generalized_procrustes(np.full((2, N_VERTICES, 3), offset + 0.1), scale=scale)


@pytest.mark.everyday
@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        (
            {"points": np.ones((4, 3)), "to": np.ones((5, 3))},
            ArgumentError,
            "points has 4 vertices .*has 5",
        ),
        ({"weights": [1, 1, -2.0, 1]}, ArgumentError, "the smallest is -2, the largest 1"),
    ],
)
def test_bad_arguments_are_refused_by_name(arguments, error, message):
    arguments = {"points": np.eye(4, 3)[np.newaxis], "to": np.eye(4, 3), **arguments}
    with pytest.raises(error, match=message):
        procrustes(**arguments)


@pytest.mark.parametrize("up", AXES)
def test_what_is_up_comes_to_y_by_a_rotation(up):
    turned = make_upright(np.eye(3), up=up)
    direction = (-1 if up.startswith("-") else 1) * np.eye(3)["xyz".index(up[-1])]
    np.testing.assert_array_equal(make_upright(direction, up=up), [0, 1, 0])
    np.testing.assert_array_equal(turned @ turned.T, np.eye(3))
    assert np.linalg.det(turned) == pytest.approx(1)


def test_units():
    np.testing.assert_allclose(make_upright(np.array([1800.0, 0, 0]), "millimetres"), [1.8, 0, 0])
    points = np.ones((2, 4, 3))
    assert make_upright(points) is points
    with pytest.raises(ArgumentError, match="unit must be one of"):
        make_upright(points, "feet")
    with pytest.raises(ArgumentError, match="up must be one of"):
        make_upright(points, up="w")


def test_no_surfaces_have_no_mean():
    with pytest.raises(ArgumentError, match="points must hold at least one surface"):
        generalized_procrustes(np.ones((0, 4, 3)))
