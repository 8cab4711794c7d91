"""Jobs on disk: the same bits as in memory, whatever happens on the way."""

import errno
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import namedtuple
from pathlib import Path

import numpy as np
import pytest
from cases import cases_that, name_of, open_template, sphere_template, surfaces
from lengths import FULL, sample

from riemhuman.errors import (
    ArgumentError,
    ArgumentTypeError,
    DamagedFileWarning,
    DegenerateSurfaceError,
    FileError,
    FileFormatError,
)
from riemhuman.geometry import (
    AlignedSurfaces,
    ElasticMetric,
    PullbackMetric,
    RiemannianMetric,
    SRNFMetric,
    VectorSpace,
)
from riemhuman.io.job_folder import JobFolder
from riemhuman.retrieval import pairwise_job
from riemhuman.retrieval.job_tiles import TileReader, tiles_of
from riemhuman.retrieval.pairwise_jobs import _unfinished as unfinished_tiles

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
@pytest.mark.parametrize(
    "metric",
    [METRIC, metric_on(TEMPLATE, 1.0, 1e-4, 0.1), SRNFMetric(METRIC.space)],
    ids=["pose", "both", "srnf"],
)
def test_same_bits_as_in_memory(metric, precision, tmp_path):
    distances = pairwise_job(metric, POINTS, tmp_path / "job", precision=precision, memory=MEMORY)
    expected = metric.dist_pairwise(POINTS, precision=precision)
    np.testing.assert_array_equal(distances, expected)
    assert isinstance(distances, np.memmap)
    assert not distances.flags.writeable
    kept = {"D.npy", "digests.npy", "manifest.json"}
    assert {entry.name for entry in (tmp_path / "job").iterdir()} == kept
    np.testing.assert_array_equal(np.load(tmp_path / "job" / "D.npy"), expected)


@pytest.mark.parametrize("case", cases_that("dist"), ids=name_of)
def test_every_metric_with_a_distance(case, tmp_path):
    distances = pairwise_job(case.metric, case.points, tmp_path, n_jobs=2)
    np.testing.assert_array_equal(distances, case.metric.dist_pairwise(case.points))


def test_layout_changes_no_bit(tmp_path):
    runs = [
        pairwise_job(METRIC, POINTS, tmp_path / str(memory), memory=memory).tobytes()
        for memory in (20_000, MEMORY, 10**6, 10**9)
    ]
    assert len(set(runs)) == 1
    sides = {
        json.loads((tmp_path / str(memory) / "manifest.json").read_text())["layout"]["tile"]
        for memory in (20_000, MEMORY, 10**6)
    }
    assert len(sides) == 3


def test_points_made_on_the_fly(tmp_path):
    points = OnTheFly(POINTS)
    distances = pairwise_job(METRIC, points, tmp_path, memory=MEMORY)
    np.testing.assert_array_equal(distances, METRIC.dist_pairwise(POINTS))
    # Once for a look at the first; then each once.
    assert sum(len(POINTS[part]) for part in points.asked) == N_POINTS + 1
    assert max(len(POINTS[part]) for part in points.asked) < N_POINTS


def test_points_mapped_from_a_file(tmp_path):
    np.save(tmp_path / "points.npy", POINTS.astype(np.float32))
    points = np.load(tmp_path / "points.npy", mmap_mode="r")
    distances = pairwise_job(METRIC, points, tmp_path / "job")
    np.testing.assert_array_equal(distances, METRIC.dist_pairwise(points))


def test_one_point(tmp_path):
    np.testing.assert_array_equal(pairwise_job(METRIC, POINTS[:1], tmp_path), [[0.0]])


def test_a_complete_job_is_opened_only(tmp_path, monkeypatch):
    first = np.array(pairwise_job(METRIC, POINTS, tmp_path))
    before = (tmp_path / "D.npy").stat().st_mtime_ns
    monkeypatch.setattr(JobFolder, "write", None)
    np.testing.assert_array_equal(pairwise_job(METRIC, POINTS, tmp_path, memory=10**9), first)
    assert (tmp_path / "D.npy").stat().st_mtime_ns == before


def test_progress_is_shown(tmp_path, capsys):
    pairwise_job(METRIC, POINTS, tmp_path / "quiet")
    assert capsys.readouterr().err == ""
    pairwise_job(METRIC, POINTS, tmp_path / "told", progress=True)
    assert "253/253" in capsys.readouterr().err


def interrupt_after(n_steps, monkeypatch, error):
    """Make the n-th change of the folder fail, and leave half of what it writes."""
    left = [n_steps]

    def failing(method):
        def run(room, *arguments):
            left[0] -= 1
            if left[0] >= 0:
                return method(room, *arguments)
            if method.__name__ == "write" and isinstance(arguments[1][1], np.ndarray):
                name, (index, values), *_ = arguments
                if np.ndim(values) == 2:
                    method(room, name, (index, np.full_like(values, 7)))
            raise error

        return run

    for name in ("write", "rename", "remove", "make_tables", "claim"):
        monkeypatch.setattr(JobFolder, name, failing(getattr(JobFolder, name)))
    return left


def test_interrupted_at_every_step(tmp_path, monkeypatch):
    expected = METRIC.dist_pairwise(POINTS)
    ended = False
    for n_steps in sample(range(1000), 7):
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


@pytest.mark.parametrize("n_steps", [40, 124])
def test_what_is_done_is_not_done_again(n_steps, tmp_path, monkeypatch):
    with monkeypatch.context() as patches:
        interrupt_after(n_steps, patches, KeyboardInterrupt)
        with pytest.raises(KeyboardInterrupt):
            pairwise_job(METRIC, POINTS, tmp_path, memory=MEMORY)
    n_done = np.count_nonzero(np.load(tmp_path / "done.npy"))
    n_blocks = int(np.load(tmp_path / "digests.npy").any(axis=1).sum())
    steps = interrupt_after(10**6, monkeypatch, KeyboardInterrupt)
    pairwise_job(METRIC, POINTS, tmp_path, memory=MEMORY)
    layout = json.loads((tmp_path / "manifest.json").read_text())["layout"]
    n_sides = -(-N_POINTS // layout["tile"])
    n_tiles = n_sides * (n_sides + 1) // 2
    n_missing = -(-N_POINTS // layout["block"]) - n_blocks
    # Five writes a block (two features, points, checksums, the digest), two a tile; four others.
    assert 10**6 - steps[0] == 5 * n_missing + 2 * (n_tiles - n_done) + 4
    assert n_blocks > 0
    assert (n_done > 0) == (n_steps > 100)


SCRIPT = """
import sys
import numpy as np
from riemhuman.geometry import AlignedSurfaces
from riemhuman.geometry import ElasticMetric
from riemhuman.retrieval import pairwise_job
from riemhuman.io.job_folder import JobFolder
from riemhuman.surfaces.template import Template

def told(room, *arguments):
    write(room, *arguments)
    print(".", end="", flush=True)

write, JobFolder.write = JobFolder.write, told
given = np.load(sys.argv[1])
metric = ElasticMetric(AlignedSurfaces(Template(given["vertices"], given["faces"])), 1.0, 0.1, 0.1)
pairwise_job(metric, given["points"], sys.argv[2], memory=120_000)
"""


def start(arguments):
    """Start a job in a process of its own, which prints a dot for everything it writes."""
    return subprocess.Popen(
        [sys.executable, "-c", SCRIPT, *map(str, arguments)],
        stdout=subprocess.PIPE,
        cwd=Path(__file__).parents[2],
    )


@pytest.mark.slow
def test_killed_at_random_moments(tmp_path):
    template = sphere_template(2)
    points = points_of(template, 60)
    given = tmp_path / "given.npz"
    np.savez(given, vertices=template.vertices, faces=template.faces, points=points)
    with start([given, tmp_path / "undisturbed"]) as process:
        n_writes = len(process.stdout.read())
        assert process.wait() == 0
    moments = random.Random(7)
    folder = tmp_path / "killed"
    n_kills = 10 if FULL else 3
    n_killed, n_tiles = 0, [0]
    # More often, should none have come after the first tile.
    while n_killed < n_kills or max(n_tiles) == 0:
        with start([given, folder]) as process:
            # On the way, the job gets to its end; it is then begun anew.
            process.stdout.read(moments.randrange(n_writes // 2))
            time.sleep(moments.uniform(0.0, 0.002))
            process.send_signal(signal.SIGKILL)
            n_killed += process.wait() == -signal.SIGKILL
        if (folder / "done.npy").exists():
            n_tiles.append(np.count_nonzero(np.load(folder / "done.npy")))
        if (folder / "D.npy").exists() and n_killed < n_kills:
            assert_same_bytes(folder, tmp_path / "undisturbed")
            shutil.rmtree(folder)
    with start([given, folder]) as process:
        process.stdout.read()
        assert process.wait() == 0
    assert_same_bytes(folder, tmp_path / "undisturbed")


def assert_same_bytes(folder, other):
    assert (folder / "D.npy").read_bytes() == (other / "D.npy").read_bytes()


def test_one_process_at_a_time(tmp_path):
    code = (
        "import sys; from riemhuman.io.job_folder import JobFolder\n"
        "with JobFolder(sys.argv[1]).locked(): print('locked', flush=True); sys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        cwd=Path(__file__).parents[2],
    ) as process:
        assert process.stdout.readline() == b"locked\n"
        with pytest.raises(FileError, match="another process is at work"):
            pairwise_job(METRIC, POINTS, tmp_path)
        assert {entry.name for entry in tmp_path.iterdir()} == {"job.lock"}
        process.send_signal(signal.SIGKILL)
    pairwise_job(METRIC, POINTS, tmp_path)


def begun(folder, monkeypatch, n_steps=30):
    """Begin a job in a folder, and interrupt it."""
    with monkeypatch.context() as patches:
        interrupt_after(n_steps, patches, KeyboardInterrupt)
        with pytest.raises(KeyboardInterrupt):
            pairwise_job(METRIC, POINTS, folder, memory=MEMORY)


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


def test_a_key_stands_for_the_metric(tmp_path):
    class Opaque(RiemannianMetric):
        def __init__(self, space):
            self.lock = threading.Lock()
            super().__init__(space)

        def squared_dist(self, point_a, point_b):
            return METRIC.squared_dist(point_a, point_b)

    metric = Opaque(METRIC.space)
    with pytest.raises(ArgumentTypeError, match="lock.*give the job a key"):
        pairwise_job(metric, POINTS, tmp_path / "job")
    assert not (tmp_path / "job").exists()
    for wrong in ("", 3):
        with pytest.raises(ArgumentTypeError, match="key must be a string"):
            pairwise_job(metric, POINTS, tmp_path / "job", key=wrong)
    found = pairwise_job(metric, POINTS[:4], tmp_path / "job", key="one")
    np.testing.assert_allclose(found, METRIC.dist_pairwise(POINTS[:4]), rtol=1e-5)
    pairwise_job(metric, POINTS[:4], tmp_path / "job", key="one")
    with pytest.raises(ArgumentError, match=r"metric\.key is 'one' there, 'two' here"):
        pairwise_job(metric, POINTS[:4], tmp_path / "job", key="two")
    with pytest.raises(ArgumentError, match=r"metric\.class is None there"):
        pairwise_job(METRIC, POINTS[:4], tmp_path / "job")


def test_an_edited_metric_does_not_get_the_old_matrix(tmp_path):
    source = "import numpy as np\ndef height(x):\n    return {}(x[..., 2])\n"
    for folder, function in (("a", "np.sin"), ("b", "np.cos")):
        namespace = {"__name__": "heights"}
        exec(source.format(function), namespace)
        metric = PullbackMetric(METRIC.space, VectorSpace((42,)).metric, namespace["height"])
        expected = metric.dist_pairwise(POINTS)
        np.testing.assert_array_equal(pairwise_job(metric, POINTS, tmp_path / folder), expected)
    with pytest.raises(ArgumentError, match=r"metric\.map\.code\.names"):
        pairwise_job(metric, POINTS, tmp_path / "a")


@pytest.mark.parametrize("exponent", [20, 30])
def test_coordinates_beyond_single_precision(exponent, tmp_path):
    points = POINTS[:5] * 10.0**exponent
    metric = ElasticMetric(AlignedSurfaces(TEMPLATE, equip=False, scale=None), 1.0, 0.1, 0.1)
    found = pairwise_job(metric, points, tmp_path)
    np.testing.assert_array_equal(found, metric.dist_pairwise(points))
    expected = metric.dist_pairwise(points, precision="double")
    np.testing.assert_allclose(found, expected, rtol=1e-5)
    assert np.isfinite(found).all()


# Files of others.

OURS = ("job.lock", "manifest.json", "manifest.json.part", "digests.npy", "features_0.npy") + (
    *("points.npy", "checksums.npy", "done.npy", "D.unfinished.npy", "D.npy"),
    *("D.unfinished.npy.part", "features_0.npy.part"),
)


def planted(path, target, kind):
    """Put something in the way of a job, in the place of what is there."""
    content = path.read_bytes() if path.is_file() else b"years of work"
    path.unlink(missing_ok=True)
    target.write_bytes(content)
    if kind == "hard link":
        os.link(target, path)
    else:
        path.symlink_to(target)
    return content


def test_a_folder_with_something_else_is_refused(tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(ArgumentError, match=r"folder must be empty.*holds thesis\.tex"):
        pairwise_job(METRIC, POINTS, tmp_path)
    (tmp_path / "D.npy").write_text("more of it")
    with pytest.raises(ArgumentError, match=r"holds D\.npy and 1 more"):
        pairwise_job(METRIC, POINTS, tmp_path)
    assert contents(tmp_path) == {"thesis.tex": b"years of work", "D.npy": b"more of it"}


@pytest.mark.parametrize("text", ["{", "[]", '{"name": "an app"}', '{"layout": 3}', "\xff"])
def test_a_manifest_of_something_else_is_refused(text, tmp_path):
    (tmp_path / "manifest.json").write_text(text, encoding="latin-1")
    with pytest.raises(FileFormatError, match=r"manifest\.json is not the manifest of a job"):
        pairwise_job(METRIC, POINTS, tmp_path)
    assert [entry.name for entry in tmp_path.iterdir()] == ["manifest.json"]


def test_half_written_files_are_written_anew(tmp_path, monkeypatch):
    (tmp_path / "manifest.json.part").write_text('{\n "form')
    begun(tmp_path, monkeypatch, n_steps=1)
    assert not (tmp_path / "done.npy").exists()
    for name in ("D.unfinished.npy.part", "features_0.npy.part"):
        (tmp_path / name).write_bytes(b"\x93NUMPY half")
    distances = pairwise_job(METRIC, POINTS, tmp_path)
    np.testing.assert_array_equal(distances, METRIC.dist_pairwise(POINTS))
    assert not list(tmp_path.glob("*.part"))


@pytest.mark.parametrize("name", ["D.unfinished.npy", "features_0.npy", "done.npy"])
def test_damaged_tables_are_refused(name, tmp_path, monkeypatch):
    begun(tmp_path, monkeypatch)
    whole = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(whole[:-5])
    with pytest.raises(FileFormatError, match=f"{name} is not a table"):
        pairwise_job(METRIC, POINTS, tmp_path)
    np.save(tmp_path / name, np.zeros(3))
    with pytest.raises(FileFormatError, match=rf"{name} is damaged: .* found float64 of shape"):
        pairwise_job(METRIC, POINTS, tmp_path)
    (tmp_path / name).write_bytes(whole)
    pairwise_job(METRIC, POINTS, tmp_path)


def flip_bit(file, position):
    """Flip one bit of a file, counted in bytes from its end."""
    with file.open("r+b") as stream:
        stream.seek(-position, os.SEEK_END)
        (byte,) = stream.read(1)
        stream.seek(-position, os.SEEK_END)
        stream.write(bytes([byte ^ 4]))


# Steps of the job: five for each of 23 blocks of features, two for each of six tiles.
@pytest.mark.parametrize(
    ("n_steps", "name", "said"),
    [
        (126, "D.unfinished.npy", r"tile \d+, distances \[\d+:\d+, \d+:\d+\], is not what"),
        (126, "features_0.npy", r"its data for points\[\d+:\d+\] are not what was written"),
        (126, "features_1.npy", r"its data for points\[\d+:\d+\] are not what was written"),
        (126, "points.npy", r"its data for points\[\d+:\d+\] are not what was written"),
        (126, "checksums.npy", r"its data for points\[\d+:\d+\] are not what was written"),
        (126, "done.npy", r"D\.unfinished\.npy is damaged: tile \d+"),
    ],
)
def test_a_flipped_bit_is_noticed_and_mended(n_steps, name, said, tmp_path, monkeypatch):
    begun(tmp_path, monkeypatch, n_steps)
    assert 0 < np.count_nonzero(np.load(tmp_path / "done.npy")) < 6
    rng = np.random.default_rng(3)
    table = np.load(tmp_path / name, mmap_mode="r")
    # Among the entries that have been written; of marks, in their checksums.
    written = np.flatnonzero(np.ascontiguousarray(table).view(np.uint8).ravel())
    position = table.nbytes - int(rng.choice(written))
    flip_bit(tmp_path / name, 8 * len(table) if name == "done.npy" else position)
    with pytest.warns(DamagedFileWarning, match=f"{said}.*; (it is|they are) computed again"):
        distances = pairwise_job(METRIC, POINTS, tmp_path, memory=MEMORY)
    np.testing.assert_array_equal(distances, METRIC.dist_pairwise(POINTS))


def test_every_distance_is_watched(tmp_path, monkeypatch):
    begun(tmp_path, monkeypatch, 5 * N_POINTS + 10)
    room, file = JobFolder(tmp_path), tmp_path / "D.unfinished.npy"
    layout = json.loads((tmp_path / "manifest.json").read_text())["layout"]
    tiles = list(tiles_of(N_POINTS, layout["tile"]))
    todo = unfinished_tiles(room, tiles)
    assert 0 < len(todo) < len(tiles) - 2
    for entry in range(0, N_POINTS * layout["tile"], 5):
        row, column = divmod(entry, N_POINTS)
        # In a row of finished tiles, and mirrored.
        for place in (entry, column * N_POINTS + row):
            position = 8 * (N_POINTS**2 - place) - entry % 8
            flip_bit(file, position)
            with pytest.warns(DamagedFileWarning, match="tile"):
                assert len(unfinished_tiles(room, tiles)) == len(todo) + 1
            flip_bit(file, position)
    assert unfinished_tiles(room, tiles) == todo


def test_a_bit_flipped_while_the_job_runs(tmp_path, monkeypatch):
    def flipping(reader, metric, tile):
        if tile.rows.start > 0 and not flipped:
            flipped.append(tile)
            flip_bit(tmp_path / "D.unfinished.npy", 8 * N_POINTS**2 - 9)
        return distances_of(reader, metric, tile)

    flipped = []
    distances_of = TileReader.distances
    monkeypatch.setattr(TileReader, "distances", flipping)
    with pytest.warns(DamagedFileWarning, match="tile 0, distances"):
        distances = pairwise_job(METRIC, POINTS, tmp_path, memory=MEMORY)
    assert flipped
    np.testing.assert_array_equal(distances, METRIC.dist_pairwise(POINTS))


@pytest.mark.parametrize("name", ["features_0.npy", "points.npy"])
@pytest.mark.parametrize("interrupted", [False, True])
def test_damaged_features_are_not_made_into_distances(interrupted, name, tmp_path, monkeypatch):
    def flipping(reader, metric, tile):
        if interrupted and tile.rows.start > 0:
            raise KeyboardInterrupt
        if not flipped:
            flipped.append(tile)
            flip_bit(tmp_path / name, 9)
        return distances_of(reader, metric, tile)

    flipped = []
    distances_of = TileReader.distances
    points = POINTS.copy()
    points[-1] = points[0] * (1 + 1e-9)  # so that the last point itself is looked at
    error = KeyboardInterrupt if interrupted else FileFormatError
    with monkeypatch.context() as patches:
        patches.setattr(TileReader, "distances", flipping)
        with pytest.raises(
            error, match=None if interrupted else rf"{name} is damaged: .*\[22:23\]"
        ):
            pairwise_job(METRIC, points, tmp_path, memory=MEMORY)
    assert np.load(tmp_path / "done.npy").any()
    with pytest.warns(DamagedFileWarning, match=rf"{name} is damaged: .*\[22:23\]"):
        distances = pairwise_job(METRIC, points, tmp_path, memory=MEMORY)
    np.testing.assert_array_equal(distances, METRIC.dist_pairwise(points))


def test_a_disk_that_keeps_nothing_is_given_up(tmp_path, monkeypatch):
    def forgetful(room, name, *entries):
        write(room, name, *entries)
        if name == "D.unfinished.npy":
            flip_bit(room.path / name, 8 * N_POINTS**2 - 9)

    write = JobFolder.write
    monkeypatch.setattr(JobFolder, "write", forgetful)
    with (
        pytest.warns(DamagedFileWarning),
        pytest.raises(FileFormatError, match="does not keep what is written to it"),
    ):
        pairwise_job(METRIC, POINTS, tmp_path, memory=10**8)
    assert not (tmp_path / "D.npy").exists()


def test_a_file_where_the_folder_should_be(tmp_path):
    file = tmp_path / "results"
    file.write_text("kept")
    for folder in (file, file / "below"):
        with pytest.raises(FileError, match="cannot be used as the folder of a job"):
            pairwise_job(METRIC, POINTS, folder)
    assert file.read_text() == "kept"


def refuse(error_number):
    def raise_error(*arguments, **options):
        raise OSError(error_number, os.strerror(error_number))

    return raise_error


def test_a_disk_too_small_is_noticed_first(tmp_path, monkeypatch):
    usage = namedtuple("usage", "total used free")
    with monkeypatch.context() as patches:
        patches.setattr(shutil, "disk_usage", lambda path: usage(10**6, 990_000, 10_000))
        with pytest.raises(FileError, match=r"no room for the job: .* GB are needed, 1e-05 GB"):
            pairwise_job(METRIC, POINTS, tmp_path)
    assert not list(tmp_path.glob("*.npy*"))
    pairwise_job(METRIC, POINTS, tmp_path)


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS, errno.EDQUOT])
@pytest.mark.parametrize("call", ["posix_fallocate", "fsync", "replace"])
def test_a_failing_disk(call, number, tmp_path, monkeypatch):
    with monkeypatch.context() as patches:
        patches.setattr(os, call, refuse(number))
        with pytest.raises(FileError, match=f"cannot be written: {os.strerror(number)}"):
            pairwise_job(METRIC, POINTS, tmp_path)
    assert not list(tmp_path.glob("*.npy*"))
    pairwise_job(METRIC, POINTS, tmp_path)


def test_a_disk_that_fails_later(tmp_path, monkeypatch):
    with monkeypatch.context() as patches:
        patches.setattr(np.memmap, "flush", refuse(errno.EIO))
        with pytest.raises(FileError, match="cannot be written: Input/output error"):
            pairwise_job(METRIC, POINTS, tmp_path)
    np.testing.assert_array_equal(
        pairwise_job(METRIC, POINTS, tmp_path), METRIC.dist_pairwise(POINTS)
    )


def test_tables_are_laid_out_without_the_system_call(tmp_path, monkeypatch):
    monkeypatch.delattr(os, "posix_fallocate")
    distances = pairwise_job(METRIC, POINTS, tmp_path)
    np.testing.assert_array_equal(distances, METRIC.dist_pairwise(POINTS))


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"n_jobs": 0}, ArgumentError, "n_jobs must be -1, or at least 1; found 0"),
        ({"n_jobs": 1.5}, ArgumentTypeError, "n_jobs must be a whole number"),
        ({"precision": "half"}, ArgumentError, "precision must be one of"),
        ({"memory": "2 GiB"}, ArgumentTypeError, "memory must be a whole number"),
        ({"memory": 100}, ArgumentError, r"memory must be at least \d+ bytes .*; found 100"),
        ({"points": iter(POINTS)}, ArgumentTypeError, "points must be an array, or have a length"),
        ({"points": POINTS[:0]}, ArgumentError, "points must hold at least one point"),
        ({"points": POINTS[:, 1:]}, ArgumentError, "points must have shape"),
        ({"folder": 3}, ArgumentTypeError, "folder must be the path of a folder; found 3"),
        ({"client": "tcp://scheduler"}, ArgumentTypeError, "client must be a distributed.Client"),
    ],
)
def test_wrong_arguments(changes, error, message, tmp_path):
    arguments = {"metric": METRIC, "points": POINTS, "folder": tmp_path / "job", **changes}
    with pytest.raises(error, match=message):
        pairwise_job(**arguments)
    assert not list(tmp_path.glob("job/D*")) or "client" in changes


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


def test_a_surface_without_normals_is_named(tmp_path):
    flat = POINTS.copy()
    flat[20] = 0.0
    with pytest.raises(DegenerateSurfaceError, match=r"points\[\d+:\d+\]: every triangle"):
        pairwise_job(METRIC, flat, tmp_path, memory=MEMORY)


class Short(OnTheFly):
    """Points whose slices hold fewer than they should."""

    def __getitem__(self, part):
        return super().__getitem__(part)[: 2 if part.start else None]


def test_slices_of_another_length_are_refused(tmp_path):
    with pytest.raises(ArgumentError, match=r"points\[\d+:\d+\] must be \d+ points; found 2"):
        pairwise_job(METRIC, Short(POINTS), tmp_path, memory=10**6)


def test_another_template_of_the_same_size(tmp_path):
    template = open_template()
    points = points_of(template)
    pairwise_job(metric_on(template), points, tmp_path)
    renumbered = type(template)(template.vertices, template.faces[::-1])
    with pytest.raises(ArgumentError, match=r"template\.faces\.sha256"):
        pairwise_job(metric_on(renumbered), points, tmp_path)
