"""Scalar functions whose values and gradients are computed together."""

import autograd.numpy as anp
import numpy as np
import pytest
from autograd import grad, hessian, value_and_grad

from riemhuman.geometry.surface_metric import _with_known_gradient

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

    return _with_known_gradient(value_and_gradient, definition)


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
    function = _with_known_gradient(lambda x: (definition(x), np.ones_like(x)), definition)
    np.testing.assert_array_equal(grad(function)(X), 1.0)
