"""Too little memory is said before large tables, samples and jobs are begun."""

import math

import numpy as np
import pytest
from open_bodies import coarse_bodies

import riemhuman as rh
from riemhuman.checks.memory import available_memory, check_memory, size_text
from riemhuman.errors import OutOfMemoryError


def test_tables_beyond_all_memory_are_refused_before_the_work():
    template = coarse_bodies().template
    metric = rh.ElasticMetric(rh.AlignedSurfaces(template, equip=False), 1.0, 1e-4, 0.0)
    points = np.broadcast_to(template.vertices, (10**7, *template.vertices.shape))
    message = (
        r"a table of 10,000,000 × 10,000,000 distances needs 800\.\d TB .* left; .*pairwise_job"
    )
    with pytest.raises(OutOfMemoryError, match=message):
        metric.dist_pairwise(points)
    with pytest.raises(OutOfMemoryError, match="a table of 10,000,000 × 10,000,000 distances"):
        metric.cdist(points, points)


def test_free_memory_is_known():
    left = available_memory()
    assert left > 2**26
    assert left < 2**50 or math.isinf(left)
    check_memory(0.0, "nothing")
    if math.isfinite(left):
        with pytest.raises(OutOfMemoryError, match="a job needs .* are left; use less"):
            check_memory(2.0 * left, "a job", "use less")


@pytest.mark.parametrize(
    ("n_bytes", "text"),
    [(0, "0 bytes"), (999, "999 bytes"), (1500, "1.5 kB"), (8e9, "8.0 GB"), (2e19, "20000.0 PB")],
)
def test_sizes(n_bytes, text):
    assert size_text(n_bytes) == text
