"""Sparse operators and differentials under autograd."""

import autograd.numpy as anp
import numpy as np
import pytest
from autograd import grad, hessian, make_jvp, value_and_grad
from cases import surfaces
from oracles import mp
from scipy.sparse import csr_array, csr_matrix
from scipy.sparse import random as random_matrix

from riemhuman.kernels import differentiable
from riemhuman.kernels.differentiable import differential, entry, with_known_gradient
from riemhuman.kernels.surface import apply_operator


def an_operator(kind=csr_array):
    return kind(random_matrix(7, 5, density=0.5, rng=np.random.default_rng(0)))


@pytest.mark.parametrize("kind", [csr_array, csr_matrix])
@pytest.mark.parametrize("leading", [(), (4,), (2, 3), (0,), (2, 0)])
def test_apply_operator(kind, leading):
    operator = an_operator(kind)
    values = np.random.default_rng(1).normal(size=(*leading, 5, 3))
    expected = np.einsum("ij,...jk->...ik", operator.toarray(), values)
    found = apply_operator(operator, values)
    assert found.shape == (*leading, 7, 3)
    np.testing.assert_allclose(found, expected, atol=1e-14)


@pytest.mark.parametrize("leading", [(), (4,), (2, 3)])
def test_apply_operator_is_differentiable(leading):
    operator = an_operator()
    rng = np.random.default_rng(2)
    values, tangent = rng.normal(size=(2, *leading, 5, 3))
    weights = rng.normal(size=(*leading, 7, 3))

    def value(x):
        return anp.sum(weights * apply_operator(operator, x) ** 2)

    gradient = grad(value)(values)
    expected = 2 * np.einsum(
        "ij,...ik->...jk", operator.toarray(), weights * apply_operator(operator, values)
    )
    np.testing.assert_allclose(gradient, expected, atol=1e-13)
    pushed = make_jvp(lambda x: apply_operator(operator, x))(values)(tangent)[1]
    np.testing.assert_allclose(pushed, apply_operator(operator, tangent), atol=1e-14)
    # Of second order.
    second = grad(lambda x: anp.sum(tangent * grad(value)(x)))(values)
    expected = 2 * np.einsum(
        "ij,...ik->...jk", operator.toarray(), weights * apply_operator(operator, tangent)
    )
    np.testing.assert_allclose(second, expected, atol=1e-12)


def test_differential():
    def cube_sums(x):
        return anp.stack([anp.sum(x**3, axis=-1), x[..., 0] * x[..., 1]], axis=-1)

    x, v = np.random.default_rng(3).normal(size=(2, 4, 3))
    expected = np.stack(
        [np.sum(3 * x**2 * v, axis=-1), x[:, 0] * v[:, 1] + x[:, 1] * v[:, 0]], axis=-1
    )
    np.testing.assert_allclose(differential(cube_sums, v, x), expected, atol=1e-14)
    by_vector = grad(lambda w: anp.sum(differential(cube_sums, w, x)))(v)
    by_point = grad(lambda p: anp.sum(differential(cube_sums, v, p)))(x)
    np.testing.assert_allclose(by_vector, 3 * x**2 + x[:, [1, 0, 2]] * [1, 1, 0], atol=1e-13)
    np.testing.assert_allclose(by_point, 6 * x * v + v[:, [1, 0, 2]] * [1, 1, 0], atol=1e-13)


def test_surfaces_of_the_registry_are_seeded():
    from cases import sphere_template

    first, again = (surfaces(sphere_template(), 2, rng=1) for _ in range(2))
    np.testing.assert_array_equal(first, again)


@pytest.mark.parametrize("index", [(0, 1), (slice(1), slice(1)), (slice(1, None), 0)])
def test_entries_and_their_derivatives_are_those_of_indexing(index):
    rng = np.random.default_rng(4)
    values, tangent = rng.normal(size=(2, 5, 2, 2))

    def by_entry(x):
        return anp.sum(anp.sin(entry(x, *index)) ** 2)

    def by_index(x):
        return anp.sum(anp.sin(x[(..., *index)]) ** 2)

    np.testing.assert_array_equal(entry(values, *index), values[(..., *index)])
    for derivative in (grad, lambda f: grad(lambda x: anp.sum(tangent * grad(f)(x)))):
        np.testing.assert_allclose(
            derivative(by_entry)(values), derivative(by_index)(values), rtol=1e-13
        )
    assert make_jvp(by_entry)(values)(tangent)[1] == pytest.approx(
        make_jvp(by_index)(values)(tangent)[1], rel=1e-13
    )
    along = make_jvp(grad(by_entry))(values)(tangent)[1]
    np.testing.assert_allclose(along, make_jvp(grad(by_index))(values)(tangent)[1], rtol=1e-13)


VALUES = (-30.0, -2.0, -1e-3, -1e-9, 0.0, 1e-300, 1e-9, 1e-4, 0.5, 3.0, 50.0)


@pytest.fixture(autouse=True)
def _strict_floats():
    with np.errstate(divide="raise", over="raise", invalid="raise"):
        yield


@pytest.mark.parametrize(
    ("function", "exact"),
    [
        (differentiable.sine_cardinal, lambda x: mp.sin(x) / x if x else mp.mpf(1)),
        (differentiable.hyperbolic_sine_cardinal, lambda x: mp.sinh(x) / x if x else mp.mpf(1)),
        (
            differentiable.inverse_hyperbolic_sine_cardinal,
            lambda x: x / mp.sinh(x) if x else mp.mpf(1),
        ),
    ],
)
def test_cardinal_functions(function, exact):
    expected = [float(exact(mp.mpf(x))) for x in VALUES]
    np.testing.assert_allclose([function(x) for x in VALUES], expected, rtol=1e-14)
    np.testing.assert_allclose(function(np.array(VALUES)), expected, rtol=1e-14)
    assert grad(function)(0.0) == 0.0
    for x in (-2.0, 0.5, 3.0):
        slope = float(mp.diff(exact, x))
        np.testing.assert_allclose(grad(function)(x), slope, rtol=1e-12)
    assert abs(grad(function)(1e-9)) < 1e-6


def test_far_values_do_not_overflow():
    assert differentiable.inverse_hyperbolic_sine_cardinal(1e4) == 0.0
    assert differentiable.inverse_hyperbolic_sine_cardinal(-1e4) == 0.0


def test_square_root():
    np.testing.assert_array_equal(
        differentiable.square_root(np.array([0.0, 4.0, -1e-17])), [0.0, 2.0, 0.0]
    )
    np.testing.assert_array_equal(
        [grad(differentiable.square_root)(x) for x in (0.0, 4.0, -1e-17)], [0.0, 0.25, 0.0]
    )
    np.testing.assert_allclose(grad(grad(differentiable.square_root))(4.0), -1 / 32)
    assert grad(grad(differentiable.square_root))(0.0) == 0.0


def test_product_minus_square_is_exact():
    rng = np.random.default_rng(0)
    c = rng.normal(size=1000)
    a = np.exp(rng.normal(size=1000))
    for gap in (1.0, 1e-6, 1e-14, 0.0):
        b = c**2 / a * (1 + gap * rng.uniform(size=1000))
        exact = [
            float(mp.mpf(x) * mp.mpf(y) - mp.mpf(z) ** 2) for x, y, z in zip(a, b, c, strict=True)
        ]
        np.testing.assert_allclose(differentiable.product_minus_square(a, b, c), exact, rtol=1e-15)
        with pytest.raises(AssertionError):
            # What plain arithmetic would give.
            np.testing.assert_allclose(a * b - c**2, exact, rtol=1e-15)
    for argument, expected in ((0, 3.0), (1, 2.0), (2, -10.0)):
        assert grad(differentiable.product_minus_square, argument)(2.0, 3.0, 5.0) == expected


X = np.array([[0.3, -1.2], [2.0, 0.7]])


def definition(x):
    return anp.sum(anp.sin(x) * x**2) + x[0, 0] * x[1, 1] ** 2


@pytest.fixture
def calls():
    return []


@pytest.fixture
def function(calls):
    def value_and_gradient(x):
        calls.append(x.copy())
        return value_and_grad(definition)(x)

    return with_known_gradient(value_and_gradient, definition)


def test_value_and_gradient_cost_one_evaluation(function, calls):
    value, gradient = value_and_grad(function)(X)
    assert value == definition(X)
    np.testing.assert_array_equal(gradient, grad(definition)(X))
    assert len(calls) == 1
    assert function(X) == definition(X)


def test_it_can_be_part_of_another_function(function):
    def outer(f):
        return lambda x: anp.exp(0.1 * f(2.0 * x)) + anp.sum(x)

    np.testing.assert_allclose(grad(outer(function))(X), grad(outer(definition))(X), rtol=1e-14)


def test_higher_derivatives(function):
    np.testing.assert_allclose(hessian(function)(X), hessian(definition)(X), rtol=1e-12)

    def third(f):
        return grad(lambda x: anp.sum(grad(lambda y: anp.sum(grad(f)(y) ** 2))(x) ** 3))(X)

    np.testing.assert_allclose(third(function), third(definition), rtol=1e-10)


def test_a_wrong_gradient_is_taken_at_its_word():
    function = with_known_gradient(lambda x: (definition(x), np.ones_like(x)), definition)
    np.testing.assert_array_equal(grad(function)(X), 1.0)
