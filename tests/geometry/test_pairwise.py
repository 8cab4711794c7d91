"""Tables of distances: exact to what is promised, the same bits however they are computed."""

import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from cases import CASES, HalfPlane, sphere_template, surfaces
from open_bodies import coarse_bodies
from scipy.spatial.distance import cdist

from riemhuman.errors import ArgumentError, ArgumentTypeError, DegenerateSurfaceError
from riemhuman.geometry import (
    AlignedSurfaces,
    ElasticMetric,
    RiemannianMetric,
    SRNFMetric,
)

WEIGHTS = [(1.0, 1e-4, 0.0), (0.0, 0.0, 1.0), (1.0, 1.0, 0.0), (1.0, 0.1, 0.1), "srnf"]
each_metric = pytest.mark.parametrize("weights", WEIGHTS, ids=str)


def metric_of(template, weights):
    space = AlignedSurfaces(template, equip=False, scale=None)
    return SRNFMetric(space) if weights == "srnf" else ElasticMetric(space, *weights)


def by_definition(metric, points):
    """Return the matrix of `dist`."""
    matrix = np.zeros((len(points), len(points)))
    for i in range(len(points)):
        for j in range(i):
            matrix[i, j] = matrix[j, i] = metric.dist(points[i], points[j])
    return matrix


def check_against_definition(metric, points, single=1e-5, double=1e-10):
    expected = by_definition(metric, points)
    assert np.all(np.isfinite(expected))
    for precision, tolerance in (("single", single), ("double", double)):
        found = metric.dist_pairwise(points, precision=precision)
        np.testing.assert_allclose(found, expected, rtol=tolerance, atol=0)


# The embedded bodies.


@each_metric
def test_embedded_bodies(weights):
    bodies = coarse_bodies()
    metric = metric_of(bodies.template, weights)
    check_against_definition(metric, bodies.points[::21])
    single = metric.dist_pairwise(bodies.points[::9])
    double = metric.dist_pairwise(bodies.points[::9], precision="double")
    np.testing.assert_allclose(single, double, rtol=1e-5, atol=0)


# Pairs too close for single precision, and other hard ones.

TEMPLATE = sphere_template(2)


def near_duplicates(template):
    """Return a surface, the same again, and disturbed by less and less."""
    f = surfaces(template, 1, rng=1)[0]
    noise = np.random.default_rng(2).standard_normal((7, *f.shape))
    return np.stack([f, f, *(f + 10.0**-k * noise[k - 3] for k in range(3, 10))])


@pytest.mark.parametrize(
    "weights", [*WEIGHTS, (1.0, 1e-8, 0.0), (1.0, 1e4, 0.0), (1.0, 1e-8, 1e-6)], ids=str
)
def test_near_duplicates(weights):
    metric, points = metric_of(TEMPLATE, weights), near_duplicates(TEMPLATE)
    # The definition itself has rounding errors of 1e-15 in the surfaces to contend with.
    check_against_definition(metric, points, double=1e-5)
    for precision in ("single", "double"):
        assert metric.dist_pairwise(points, precision=precision)[0, 1] == 0.0
        assert metric.cdist(points[:1], points[1:2], precision=precision) == 0.0


@each_metric
def test_bodies_far_apart_in_scale(weights):
    scales = np.array([1e-25, 1e-12, 1e-3, 1.0, 1e3, 1e12])
    points = scales[:, None, None] * surfaces(TEMPLATE, 6, rng=5)
    check_against_definition(metric_of(TEMPLATE, weights), points)


def test_triangles_without_area():
    points = surfaces(TEMPLATE, 4, rng=8)
    points[1, TEMPLATE.faces[3]] = points[1, TEMPLATE.faces[3, 0]]
    points[3] = 0.0
    for weights in ((1.0, 1e-4, 0.0), (1.0, 1.0, 0.0), "srnf"):
        check_against_definition(metric_of(TEMPLATE, weights), points)
    for weights in ((0.0, 0.0, 1.0), (1.0, 1.0, 1.0)):
        metric = metric_of(TEMPLATE, weights)
        with pytest.raises(DegenerateSurfaceError, match=r"triangle \d+ of item \(1,\)"):
            metric.dist_pairwise(points)
        with pytest.raises(DegenerateSurfaceError, match=r"points_b\[1:2\]: .*item \(0,\)"):
            metric.cdist(points[:1], points, memory=1)


# The same bits however the table is computed.


@each_metric
def test_bits_do_not_depend_on_threads_blocks_or_company(weights):
    metric, points = metric_of(TEMPLATE, weights), surfaces(TEMPLATE, 9, rng=9)
    points[5] = points[4] + 1e-7 * points[3]
    whole = metric.dist_pairwise(points)
    np.testing.assert_array_equal(metric.dist_pairwise(points, n_jobs=2), whole)
    np.testing.assert_array_equal(metric.cdist(points, points[::-1])[:, ::-1], whole)
    np.testing.assert_array_equal(metric.cdist(points[2:5], points[5:]), whole[2:5, 5:])
    size = sum(array.nbytes for array in metric.features(points[:1], "single"))
    for memory in (1, 4 * size, 8 * size, 9 * size):
        np.testing.assert_array_equal(metric.dist_pairwise(points, memory=memory), whole)
        np.testing.assert_array_equal(
            metric.cdist(points[:4], points, n_jobs=2, memory=memory), whole[:4]
        )
    # Blocks of two points.
    np.testing.assert_array_equal(metric.dist_pairwise(points, n_jobs=5), whole)


@each_metric
def test_bits_do_not_depend_on_how_many_pairs_are_close(weights):
    """Close pairs are computed again sixteen points at a time: here twenty, and one by one."""
    metric, points = metric_of(TEMPLATE, weights), surfaces(TEMPLATE, 20, rng=11)
    points = np.concatenate([points, points * (1 + 1e-9)])
    whole = metric.dist_pairwise(points)
    for first in range(0, 40, 7):
        rows = metric.cdist(points[first : first + 1], points)
        np.testing.assert_array_equal(rows[0], whole[first])


# Points and memory.


class Asked:
    """A sequence of points that remembers the longest slice it was asked for."""

    def __init__(self, points):
        self.points, self.longest = points, 0

    def __len__(self):
        return len(self.points)

    def __getitem__(self, index):
        part = self.points[index]
        if isinstance(index, slice):
            self.longest = max(self.longest, len(part))
        return part


def test_points_are_sliced_as_the_budget_allows(tmp_path):
    metric, points = (metric_of(TEMPLATE, (0.0, 0.0, 1.0)), surfaces(TEMPLATE, 12, rng=10))
    whole = metric.dist_pairwise(points)
    size = sum(array.nbytes for array in metric.features(points[:1], "single"))
    asked = Asked(points)
    np.testing.assert_array_equal(metric.dist_pairwise(asked, memory=6 * size), whole)
    assert asked.longest == 3
    np.testing.assert_array_equal(metric.dist_pairwise(asked), whole)
    assert asked.longest == 12
    np.save(tmp_path / "points.npy", points)
    mapped = np.load(tmp_path / "points.npy", mmap_mode="r")
    np.testing.assert_array_equal(metric.dist_pairwise(mapped, memory=6 * size), whole)
    np.testing.assert_array_equal(metric.cdist(list(points), mapped), whole)
    np.testing.assert_array_equal(metric.cdist(points[:0], mapped), np.zeros((0, 12)))
    np.testing.assert_array_equal(metric.cdist(mapped, points[:0]), np.zeros((12, 0)))


def test_progress_counts_every_pair_once(capsys):
    """However the work is cut."""
    metric = CASES["pose triangle"].metric
    points = surfaces(metric.space.template, 11, rng=12)
    metric.dist_pairwise(points)
    assert capsys.readouterr().err == ""
    for memory in (2**29, 1):
        metric.dist_pairwise(points, progress=True, memory=memory)
        assert "55/55" in capsys.readouterr().err
        metric.cdist(points[:7], points, progress=True, memory=memory)
        assert "77/77" in capsys.readouterr().err


def test_bad_sets_of_points():
    metric, points = CASES["pose triangle"].metric, CASES["pose triangle"].points
    spoilt = points.copy()
    spoilt[2, 0, 0] = np.nan
    for wrong, message in ((points[0], "must have shape"), (spoilt, "holds 1")):
        with pytest.raises(ArgumentError, match=f"points_b {message}"):
            metric.cdist(points, wrong)
        with pytest.raises(ArgumentError, match=f"points_a {message}"):
            metric.cdist(wrong, points)
        with pytest.raises(ArgumentError, match=f"points {message}"):
            metric.dist_pairwise(wrong)
    with pytest.raises(ArgumentError, match="precision must be"):
        metric.features(points, "quadruple")
    # A set has a length but no order, and an iterator has neither.
    for wrong, found in (({1.0, 2.0}, "set"), (iter(points), "iterator"), (None, "None")):
        with pytest.raises(ArgumentTypeError, match=f"points must be an array of .* {found}"):
            metric.dist_pairwise(wrong)


# Metrics of users.


@pytest.mark.parametrize(("n_jobs", "elsewhere"), [(None, False), (2, True)])
def test_distances_of_users_are_asked_for_once_a_pair(n_jobs, elsewhere):
    """By the caller's own thread, unless others are asked for."""

    class Counted(RiemannianMetric):
        def squared_dist(self, point_a, point_b):
            asked.append((point_a[1], point_b[1], threading.current_thread() is not caller))
            return np.sum((point_a - point_b) ** 2)

    metric, points = Counted(HalfPlane()), HalfPlane().random_point(5, rng=14)
    heights, asked, caller = points[:, 1].tolist(), [], threading.current_thread()
    found = metric.dist_pairwise(points, n_jobs=n_jobs)
    np.testing.assert_allclose(found, cdist(points, points), rtol=1e-14)
    pairs = [(heights[i], heights[j], elsewhere) for i in range(5) for j in range(i + 1, 5)]
    assert sorted(asked) == sorted(pairs)


@pytest.mark.parametrize(("n_jobs", "most"), [(None, 3), (2, 60_000)])
def test_interruption_ends_the_work(n_jobs, most):
    class Interrupted(RiemannianMetric):
        calls = 0

        def squared_dist(self, point_a, point_b):
            self.calls += 1
            if self.calls == 3:
                raise KeyboardInterrupt
            if self.calls > 3:
                time.sleep(0.001)  # too many only if threads that are to end go on for a minute
            return 1.0

    metric = Interrupted(HalfPlane())
    with pytest.raises(KeyboardInterrupt):
        metric.dist_pairwise(HalfPlane().random_point(400, rng=0), n_jobs=n_jobs)  # of 79,800 pairs
    assert metric.calls <= most


# Single distances compile nothing.

FIRST_CALL = """
import sys
import numpy as np
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.surfaces import Template
template = Template(np.eye(3), [[0, 1, 2]])
for weights in ((1.0, 1e-4, 0.0), (0.0, 0.0, 1.0)):
    metric = ElasticMetric(AlignedSurfaces(template), *weights)
    metric.dist(template.vertices, 1.1 * template.vertices)
print("numba" in sys.modules)
"""


def test_a_single_distance_does_not_load_numba():
    result = subprocess.run([sys.executable, "-c", FIRST_CALL], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    assert result.stdout.strip() == "False"


# Out of the range of numbers.


def test_a_wrong_point_is_named_by_its_block_once():
    case = CASES["all sphere"]
    assert len(case.points) == 4
    for wrong in (0.0, np.nan):
        points = case.points.copy()
        points[3] = wrong
        with pytest.raises(ArgumentError) as caught:
            case.metric.dist_pairwise(points, n_jobs=2)  # two points a thread
        assert str(caught.value).count("points[2:4]") == 1
        with pytest.raises(ArgumentError) as caught:
            case.metric.dist_pairwise(points[2:])
        assert not str(caught.value).startswith(("points:", "points["))
