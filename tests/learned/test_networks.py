"""Small networks, by their formula."""

import numpy as np

from riemhuman.learned.networks import activated, initial_network, network, network_shapes


def test_is_what_its_formula_says():
    rng = np.random.default_rng(0)
    shapes = network_shapes("some", 4, 5, 3)
    p = {name: rng.standard_normal(shape) for name, shape in shapes.items()}
    x = rng.standard_normal((7, 4))
    expected = []
    for row in x:
        g = row @ p["some.A"] + p["some.b1"]
        g = g / (1.0 + np.exp(-g))
        b = g @ p["some.B"] + p["some.b2"]
        h = g + b / (1.0 + np.exp(-b))
        expected.append(row @ p["some.L"] + h @ p["some.C"] + p["some.b3"])
    np.testing.assert_allclose(network(p, "some", x), expected, rtol=1e-13)


def test_starts_linear_with_the_shapes_it_has():
    p = initial_network("some", 4, 5, 3, np.random.default_rng(0))
    assert {name: array.shape for name, array in p.items()} == network_shapes("some", 4, 5, 3)
    x = np.random.default_rng(1).standard_normal((2, 4))
    np.testing.assert_allclose(network(p, "some", x), x @ p["some.L"])


def test_activation_does_not_overflow():
    np.testing.assert_array_equal(activated(np.array([-1e6, 0.0, 1e6])), [0.0, 0.0, 1e6])
