"""Checks of manifolds: every space of the library passes, and broken twins do not."""

import numpy as np
import pytest
from cases import CASES, HalfPlane, sphere_template

from riemhuman.geometry import NormalFields
from riemhuman.testing import check_manifold

SPACES = {type(case.space).__name__: case.space for case in CASES.values()}


@pytest.mark.parametrize("space", SPACES.values(), ids=SPACES)
def test_every_space_passes(space):
    report = check_manifold(space)
    assert report.passed, report
    assert report.name == type(space).__name__
    assert len(report.checks) == 13


class Tilted(NormalFields):
    """One method of normal fields at a time, broken."""

    broken = ""

    def belongs(self, point, atol=1e-9):
        if self.broken == "shape-blind":
            point = np.asarray(point)[..., :3]
        if self.broken == "trusting" and np.isnan(point).any():
            return np.ones(np.shape(point)[:-2], dtype=bool)
        if self.broken == "refusing":
            return np.zeros(np.shape(point)[:-2], dtype=bool)
        return super().belongs(point, atol)

    def to_tangent(self, vector, base_point=None):
        tangent = super().to_tangent(vector, base_point)
        if self.broken == "idle":
            return vector
        if self.broken == "shrinking":
            return 0.5 * tangent
        if self.broken == "bent":
            return np.sign(tangent) * tangent**2
        if self.broken == "slipping" and np.ndim(vector) > 2:
            return tangent + 1.0
        if self.broken == "mixing" and np.ndim(vector) > 2:
            return tangent[::-1]
        return tangent

    def projection(self, point):
        if self.broken == "lazy":
            return point
        if self.broken == "moving":
            return -super().projection(point)
        return super().projection(point)

    def random_point(self, n_samples=1, bound=1.0, rng=None):
        if self.broken == "unseeded":
            rng = None
        if self.broken == "repeating":
            rng = 0
        point = super().random_point(n_samples, bound, rng)
        return point[None] if self.broken == "stacked" and n_samples == 1 else point


BROKEN = {
    "shape-blind": "arrays of another shape do not belong",
    "trusting": "arrays with NaN do not belong",
    "refusing": "random points belong",
    "idle": "tangent spaces have dimension dim",
    "shrinking": "to_tangent does not change tangent vectors",
    "bent": "to_tangent is linear",
    "slipping": "random tangent vectors are tangent",
    "mixing": "results for a stack of tangent vectors are those of each vector",
    "lazy": "projections of nearby arrays belong",
    "moving": "projection does not move points of the manifold",
    "unseeded": "the same seed gives the same random points",
    "repeating": "each call draws different random points",
    "stacked": "random points have the right shape",
}


@pytest.mark.parametrize(("broken", "name"), BROKEN.items(), ids=BROKEN)
def test_every_property_tells_a_broken_twin(broken, name):
    space = Tilted(sphere_template())
    assert check_manifold(space).passed
    space.broken = broken
    failures = [check.name for check in check_manifold(space).failures]
    assert name in failures


def test_every_property_is_told():
    assert set(BROKEN.values()) == {check.name for check in check_manifold(HalfPlane()).checks}
