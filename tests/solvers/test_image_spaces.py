"""Where statistics of surfaces are done: the mean, from wherever its search starts."""

import numpy as np
import pytest

from riemhuman.datasets import load_open_bodies
from riemhuman.errors import OutsideManifoldError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.solvers._dispersion import Dispersion
from riemhuman.solvers._image_spaces import image_space


def test_the_mean_does_not_need_logarithms_of_fields():
    bodies = load_open_bodies("coarse")
    points = bodies.points[:30:10]
    space = AlignedSurfaces(bodies.template)
    space.equip_with_metric(ElasticMetric, a=1.0, lam=1.0, c=1.0)
    fields = image_space(space.metric, "fields", None)
    variance = Dispersion(space.metric, points).value
    near = fields.mean(points)

    class NoLogarithm(type(fields.metric)):
        def log(self, point, base_point):
            raise OutsideManifoldError("the points are antipodal")

    fields.metric.__class__ = NoLogarithm
    far = fields.mean(points)
    assert variance(near) == pytest.approx(variance(far), rel=1e-3)
    assert variance(near) < 0.9 * min(variance(point) for point in points)
    assert np.abs(near - far).max() < 0.01
