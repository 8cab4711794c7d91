"""Quadratic forms of single triangles, against the inner products of the metrics."""

import numpy as np
import pytest
from cases import deformations, name_of, surface_cases, surfaces

from riemhuman.geometry.elastic_metric import ElasticMetric
from riemhuman.kernels.strain import elastic_blocks


@pytest.mark.parametrize(
    "case", [case for case in surface_cases() if case.name != "edges"], ids=name_of
)
def test_blocks_add_up_to_the_squared_norm(case):
    template = case.space.template
    f, h = surfaces(template, 1, rng=4)[0], deformations(template, 1, rng=5)[0]
    weights = {"b": 1.0}
    if isinstance(case.metric, ElasticMetric):
        weights = {"a": case.metric.a, "lam": case.metric.lam, "c": case.metric.c}
    blocks = elastic_blocks(f, template.faces, template.face_areas, **weights)
    corners = h[template.faces].reshape(-1, 9)
    found = np.einsum("ti,tij,tj->", corners, blocks, corners)
    np.testing.assert_allclose(found, case.metric.squared_norm(h, f), rtol=1e-10)
    np.testing.assert_allclose(blocks, np.swapaxes(blocks, 1, 2), rtol=1e-13, atol=1e-15)
