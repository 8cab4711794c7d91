"""Units and axes: rotations that bring what is up to y, and scales."""

import numpy as np
import pytest

from riemhuman.errors import ArgumentError
from riemhuman.surfaces.upright import AXES, upright


@pytest.mark.parametrize("up", AXES)
def test_what_is_up_comes_to_y_by_a_rotation(up):
    turned = upright(np.eye(3), up=up)
    direction = (-1 if up.startswith("-") else 1) * np.eye(3)["xyz".index(up[-1])]
    np.testing.assert_array_equal(upright(direction, up=up), [0, 1, 0])
    np.testing.assert_array_equal(turned @ turned.T, np.eye(3))
    assert np.linalg.det(turned) == pytest.approx(1)


def test_units():
    np.testing.assert_allclose(upright(np.array([1800.0, 0, 0]), "millimetres"), [1.8, 0, 0])
    points = np.ones((2, 4, 3))
    assert upright(points) is points
    with pytest.raises(ArgumentError, match="unit must be one of"):
        upright(points, "feet")
    with pytest.raises(ArgumentError, match="up must be one of"):
        upright(points, up="w")
