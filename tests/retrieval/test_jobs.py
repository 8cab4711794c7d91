"""Jobs on disk: the same numbers as in memory, whatever happens on the way."""

import shutil
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from cases import sphere_template, surfaces

import riemhuman.retrieval.jobs
from riemhuman.errors import (
    ArgumentError,
    ArgumentTypeError,
)
from riemhuman.geometry import (
    AlignedSurfaces,
    ElasticMetric,
    PullbackMetric,
    SRNFMetric,
    VectorSpace,
)
from riemhuman.io.job_folder import JobFolder
from riemhuman.retrieval import pairwise_job, path_job
from riemhuman.solvers import PathStraightening, PoissonPath, path_distances

N_POINTS = 23
# So little that there are many tiles and many blocks of features.
MEMORY = 60_000


def points_of(template, n_points=N_POINTS):
    """Return surfaces; pairs of one tile and of two are too close for single precision."""
    points = surfaces(template, n_points, rng=1)
    points[5] = points[2] * (1 + 1e-9)
    points[17] = points[3] * (1 + 1e-9)
    return points


def metric_on(template, *weights):
    return ElasticMetric(AlignedSurfaces(template, equip=False), *(weights or (0.0, 0.0, 1.0)))


TEMPLATE = sphere_template()
POINTS = points_of(TEMPLATE)
METRIC = metric_on(TEMPLATE)


class OnTheFly:
    """Points that are made when they are asked for, by slices alone."""

    def __init__(self, points):
        self.points = points
        self.asked = []

    def __len__(self):
        return len(self.points)

    def __getitem__(self, part):
        assert isinstance(part, slice)
        self.asked.append(part)
        return self.points[part].copy()


@pytest.mark.parametrize("precision", ["single", "double"])
def test_same_bits_as_in_memory(precision, tmp_path):
    metric = metric_on(TEMPLATE, 1.0, 1e-4, 0.1)
    distances = pairwise_job(metric, POINTS, tmp_path / "job", precision=precision, memory=MEMORY)
    expected = metric.dist_pairwise(POINTS, precision=precision)
    np.testing.assert_array_equal(distances, expected)
    assert isinstance(distances, np.memmap)
    assert not distances.flags.writeable
    kept = {"D.npy", "digests.npy", "manifest.json"}
    assert {entry.name for entry in (tmp_path / "job").iterdir()} == kept
    np.testing.assert_array_equal(np.load(tmp_path / "job" / "D.npy"), expected)


def test_points_made_on_the_fly(tmp_path):
    points = OnTheFly(POINTS)
    distances = pairwise_job(METRIC, points, tmp_path, memory=MEMORY)
    np.testing.assert_array_equal(distances, METRIC.dist_pairwise(POINTS))
    # Once for a look at the first; then each once.
    assert sum(len(POINTS[part]) for part in points.asked) == N_POINTS + 1
    assert len(pairwise_job(METRIC, points, tmp_path, memory=MEMORY)) == N_POINTS
    assert sum(len(POINTS[part]) for part in points.asked) <= 2 * (N_POINTS + 1) + 9
    assert max(len(POINTS[part]) for part in points.asked) < N_POINTS


def test_one_point(tmp_path):
    np.testing.assert_array_equal(pairwise_job(METRIC, POINTS[:1], tmp_path), [[0.0]])


def test_a_complete_job_is_opened_only(tmp_path, monkeypatch):
    first = np.array(pairwise_job(METRIC, POINTS, tmp_path))
    before = (tmp_path / "D.npy").stat().st_mtime_ns
    monkeypatch.setattr(JobFolder, "write", None)
    np.testing.assert_array_equal(pairwise_job(METRIC, POINTS, tmp_path, memory=10**9), first)
    assert (tmp_path / "D.npy").stat().st_mtime_ns == before


def interrupt_after(n_steps, monkeypatch, error):
    """Make the n-th change of the folder fail, and leave half of what it writes."""
    left = [n_steps]

    def failing(method):
        def run(job, *arguments):
            left[0] -= 1
            if left[0] >= 0:
                return method(job, *arguments)
            if method.__name__ == "write" and isinstance(arguments[1][1], np.ndarray):
                name, (index, values), *_ = arguments
                if np.ndim(values) == 2:
                    method(job, name, (index, np.full_like(values, 7)))
            raise error

        return run

    for name in ("write", "rename", "remove", "make_tables", "claim"):
        monkeypatch.setattr(JobFolder, name, failing(getattr(JobFolder, name)))
    return left


@pytest.mark.parametrize("stride", [7, pytest.param(1, marks=pytest.mark.slow)])
def test_interrupted_at_every_step(stride, tmp_path, monkeypatch):
    expected = METRIC.dist_pairwise(POINTS)
    ended = False
    for n_steps in range(0, 1000, stride):
        folder = tmp_path / str(n_steps)
        with monkeypatch.context() as patches:
            left = interrupt_after(n_steps, patches, KeyboardInterrupt)
            try:
                pairwise_job(METRIC, POINTS, folder, memory=300_000)
            except KeyboardInterrupt:
                assert left[0] < 0
            else:
                ended = True
                break
        resumed = pairwise_job(METRIC, POINTS, folder, memory=10**8)
        np.testing.assert_array_equal(resumed, expected)
        shutil.rmtree(folder)
    assert ended
    assert n_steps > 20


def begun(folder, monkeypatch, n_steps=30, memory=MEMORY):
    """Begin a job in a folder, and interrupt it."""
    with monkeypatch.context() as patches:
        interrupt_after(n_steps, patches, KeyboardInterrupt)
        with pytest.raises(KeyboardInterrupt):
            pairwise_job(METRIC, POINTS, folder, memory=memory)


def contents(folder):
    return {entry.name: entry.read_bytes() for entry in folder.iterdir()}


@pytest.mark.parametrize("n_steps", [30, None])
def test_another_job_is_refused(n_steps, tmp_path, monkeypatch):
    if n_steps is None:
        pairwise_job(METRIC, POINTS, tmp_path, memory=MEMORY)
    else:
        begun(tmp_path, monkeypatch, n_steps)
    before = contents(tmp_path)
    turned = type(TEMPLATE)(TEMPLATE.vertices[:, ::-1], TEMPLATE.faces)
    moved = POINTS.copy()
    moved[0, 0, 0] += 1e-12
    others = [
        ({"metric": metric_on(TEMPLATE, 0.0, 0.0, 1.0 + 1e-12)}, r"metric\.c is 1\.0 there"),
        ({"metric": SRNFMetric(METRIC.space)}, r"metric\.class is 'riemhuman.*ElasticMetric'"),
        ({"metric": metric_on(turned)}, r"template\.vertices\.sha256"),
        ({"precision": "double"}, "precision is 'single' there, 'double' here"),
        ({"points": POINTS[:-1]}, "n_points is 23 there, 22 here"),
        ({"points": moved}, r"has other points\[0:\d+\]"),
    ]
    for changes, message in others:
        arguments = {"metric": METRIC, "points": POINTS, "folder": tmp_path, **changes}
        with pytest.raises(ArgumentError, match=message):
            pairwise_job(**arguments)
        assert contents(tmp_path) == before
    pairwise_job(METRIC, POINTS, tmp_path)


SOURCE = "FACTOR = {}\ndef height(x):\n    return FACTOR * x[..., 2]\n"


def heights(factor):
    """Return a metric whose constant is in its code alone."""
    namespace = {"__name__": "heights"}
    exec(SOURCE.format(factor), namespace)
    return PullbackMetric(METRIC.space, VectorSpace((42,)).metric, namespace["height"])


@pytest.mark.parametrize(
    ("n_steps", "precision"), [(8, "single"), (70, "double"), (None, "double")]
)
def test_a_metric_whose_constant_changed_is_refused(n_steps, precision, tmp_path, monkeypatch):
    """The manifest does not hold it; features or distances that are computed again tell."""
    settings = {"precision": precision, "memory": MEMORY}
    if n_steps is None:
        pairwise_job(heights(1), POINTS, tmp_path, **settings)
    else:
        with monkeypatch.context() as patches:
            interrupt_after(n_steps, patches, KeyboardInterrupt)
            with suppress(KeyboardInterrupt):
                pairwise_job(heights(1), POINTS, tmp_path, **settings)
    before = contents(tmp_path)
    for changed in (heights(3), heights(1.001)):
        with pytest.raises(
            ArgumentError, match=r"job.* a (feature|distance) differs by .* has changed"
        ):
            pairwise_job(changed, POINTS, tmp_path, **settings)
        assert contents(tmp_path) == before
    expected = heights(1).dist_pairwise(POINTS, precision=precision)
    np.testing.assert_array_equal(pairwise_job(heights(1), POINTS, tmp_path, **settings), expected)


@pytest.mark.everyday
@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"memory": 100}, ArgumentError, r"memory must be at least \d+ bytes .*; found 100"),
        ({"points": iter(POINTS)}, ArgumentTypeError, "points must be an array, or have a length"),
        ({"points": POINTS[:0]}, ArgumentError, "points must hold at least one point"),
    ],
)
def test_wrong_arguments(changes, error, message, tmp_path):
    arguments = {"metric": METRIC, "points": POINTS, "folder": tmp_path / "job", **changes}
    with pytest.raises(error, match=message):
        pairwise_job(**arguments)
    assert not list(tmp_path.glob("job/D*"))


def test_a_wrong_point_is_named_and_what_is_done_is_kept(tmp_path):
    wrong = POINTS.copy()
    wrong[20, 3, 1] = np.nan
    with pytest.raises(ArgumentError, match=r"points\[\d+:\d+\] holds 1 NaN"):
        pairwise_job(METRIC, wrong, tmp_path, memory=MEMORY)
    wrong[20] = 1000.0 * POINTS[20]
    with pytest.raises(ArgumentError, match=r"points\[\d+:\d+\]: points\[\d+\] is .*metres"):
        pairwise_job(METRIC, wrong, tmp_path, memory=MEMORY)
    assert np.load(tmp_path / "digests.npy").any(axis=1).sum() > 0
    np.testing.assert_array_equal(
        pairwise_job(METRIC, POINTS, tmp_path), METRIC.dist_pairwise(POINTS)
    )


class Short(OnTheFly):
    """Points whose slices hold fewer than they should."""

    def __getitem__(self, part):
        return super().__getitem__(part)[: 2 if part.start else None]


def test_slices_of_another_length_are_refused(tmp_path):
    with pytest.raises(ArgumentError, match=r"points\[\d+:\d+\] must be \d+ points; found 2"):
        pairwise_job(METRIC, Short(POINTS), tmp_path, memory=10**6)


# Paths.

PATH_METRIC = ElasticMetric(AlignedSurfaces(sphere_template(), equip=False), 1.0, 0.1, 0.1)
PATH_POINTS = surfaces(sphere_template(), 9, rng=1)  # 36 pairs, in blocks of 16
SOLVER = PathStraightening(n_nodes=3, tolerance=0.1)


@pytest.fixture(scope="module")
def expected():
    return path_distances(SOLVER, PATH_METRIC, PATH_POINTS)


def assert_same(found, expected):
    for name in ("lengths", "bounds", "gaps"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
    assert found.outcome == expected.outcome


def test_same_paths_as_in_memory(expected, tmp_path):
    assert_same(path_job(SOLVER, PATH_METRIC, PATH_POINTS, tmp_path, n_jobs=2), expected)


def test_goes_on_where_it_was_stopped(expected, tmp_path, monkeypatch):
    finder = riemhuman.retrieval.jobs.PathFinder
    find, asked = finder.compute, []

    def stopped(self, metric, block):
        if len(asked) == 2:
            raise KeyboardInterrupt
        asked.append(block)
        return find(self, metric, block)

    monkeypatch.setattr(finder, "compute", stopped)
    with pytest.raises(KeyboardInterrupt):
        path_job(SOLVER, PATH_METRIC, PATH_POINTS, tmp_path)
    monkeypatch.setattr(finder, "compute", lambda *call: (asked.append(call[-1]), find(*call))[1])
    assert_same(path_job(SOLVER, PATH_METRIC, PATH_POINTS, tmp_path), expected)
    # The first pair is solved again, to be compared.
    assert [block.start for block in asked] == [0, 16, 0, 32]


def test_a_pair_that_is_refused_loses_no_other_block(tmp_path):
    points = PATH_POINTS.copy()
    first, second, _ = PATH_METRIC.space.template.faces[0]
    points[1, first] = points[1, second]
    with pytest.raises(ArgumentError, match=r"^points\[0\] and points\[1\]: .*except 1 of 3"):
        path_job(PoissonPath(4), PATH_METRIC, points, tmp_path, n_jobs=2)
    lengths = np.load(tmp_path / "rows.npy")[:, 0]
    expected = path_distances(PoissonPath(4), PATH_METRIC, points[2:]).lengths
    # All pairs of this point are in the first block, with one pair of others.
    np.testing.assert_array_equal(lengths[:16], 0.0)
    np.testing.assert_array_equal(lengths[16:], expected[np.triu_indices(7, 1)][1:])


def test_another_job_of_paths_is_refused(tmp_path):
    path_job(PoissonPath(4), PATH_METRIC, PATH_POINTS, tmp_path)
    for solver, metric, points, what in (
        (PoissonPath(5), PATH_METRIC, PATH_POINTS, "solver"),
        (PoissonPath(4), ElasticMetric(PATH_METRIC.space, 1.0, 0.2, 0.1), PATH_POINTS, "metric"),
        (PoissonPath(4), PATH_METRIC, PATH_POINTS + 1e-9, "points"),
    ):
        with pytest.raises(ArgumentError, match=what):
            path_job(solver, metric, points, tmp_path)
    with pytest.raises(ArgumentError, match="two"):
        path_job(PoissonPath(4), PATH_METRIC, PATH_POINTS[:1], tmp_path / "other")


class Bent(PoissonPath):
    """A solver whose constant is in its code alone."""

    bend = 0.0

    def solve(self, metric, start, end):
        result = super().solve(metric, start, end)
        path = result.path.copy()
        path[1] += self.bend * np.sin(np.arange(path[1].size)).reshape(path[1].shape)
        return replace(result, path=path)


def test_a_solver_whose_constant_changed_is_refused(tmp_path, monkeypatch):
    path_job(Bent(4), PATH_METRIC, PATH_POINTS, tmp_path)
    monkeypatch.setattr(Bent, "bend", 0.01)
    with pytest.raises(ArgumentError, match="the length of a path differs by .* has changed"):
        path_job(Bent(4), PATH_METRIC, PATH_POINTS, tmp_path)
