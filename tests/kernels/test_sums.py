"""Integrals over the template."""

import numpy as np
from autograd import grad

from riemhuman.kernels.sums import integrate


def test_integrate():
    values = np.arange(12.0).reshape(2, 2, 3)
    areas = np.array([1.0, 10.0, 100.0])
    np.testing.assert_array_equal(integrate(values, areas), [[210, 543], [876, 1209]])
    np.testing.assert_array_equal(grad(integrate)(values[0, 0], areas), areas)
