"""Mistakes of structure, by hand: in blocks, caches, order and files. Do the tests notice them?

``PYTHONPATH=tests:. python tests/trust/mutants.py`` makes one mistake after the other in a copy of
the package, and runs the tests that must notice it. Where the text that a mistake changes is no
longer there, or there twice, it says so and fails: the table has to follow the code.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Mutant:
    """A mistake.

    Attributes
    ----------
    file : str
        File of the package.
    old, new : str
        What stands there once, and what shall.
    tests : str
        Arguments of pytest: what must notice it, below `tests`.
    """

    file: str
    old: str
    new: str
    tests: str


JOB = "jobs/test_pairwise.py"
FINGERPRINT = "storage/test_fingerprint.py"
CUTS = "geometry/test_block_boundaries.py"
NEIGHBORS = "retrieval/test_neighbor_boundaries.py"

MUTANTS = [
    # Jobs: what is checked, what is written first, what is forgotten.
    Mutant(
        "jobs/pairwise.py",
        "        if not np.array_equal(kept, found):\n",
        "        if False:\n",
        f"{JOB} -k another_job",
    ),
    Mutant(
        "jobs/pairwise.py",
        "    for name, array in zip(names, written, strict=True):\n",
        "    job.write(_DIGESTS, (number, found))\n"
        "    for name, array in zip(names, written, strict=True):\n",
        f"{JOB} -k interrupted_at_every",
    ),
    Mutant(
        "jobs/pairwise.py",
        "                    ((tile.columns, tile.rows), block.T),\n",
        "",
        f"{JOB} -k same_bits",
    ),
    Mutant(
        "jobs/pairwise.py",
        "        for side in (tile.rows, tile.columns):\n",
        "        for side in (tile.rows,):\n",
        f"{JOB} -k damaged_features",
    ),
    Mutant(
        "jobs/pairwise.py",
        "            _check_features(job, kept, blocks, tiles)\n            job.rename",
        "            job.rename",
        f"{JOB} -k damaged_features",
    ),
    Mutant(
        "jobs/pairwise.py",
        "        job.remove(_DONE, _CHECKSUMS, *arrays)\n",
        "        job.remove(_DONE, _CHECKSUMS)\n",
        "trust/test_chaos.py",
    ),
    Mutant(
        "jobs/pairwise.py",
        "mark(distances[tile.rows, tile.columns]), mark(mirrored)",
        "mark(distances[tile.rows, tile.columns])",
        f"{JOB} -k every_distance_is_watched",
    ),
    Mutant(
        "jobs/pairwise.py",
        "    for k, name in enumerate(names):\n",
        "    for k, name in enumerate(names[:1]):\n",
        f"{JOB} -k damaged_features",
    ),
    Mutant(
        "jobs/tiles.py",
        "        if self._rows is None or self._rows[0] != tile.rows:\n",
        "        if self._rows is None:\n",
        f"{JOB} -k same_bits",
    ),
    Mutant(
        "jobs/tiles.py",
        "points[tile.rows], points[tile.columns]",
        "points[tile.rows], points[tile.rows]",
        f"{JOB} -k same_bits",
    ),
    Mutant(
        "storage/checksums.py",
        "zlib.crc32(row.data) for row",
        "zlib.crc32(row[:4096].data) for row",
        "storage/test_checksums.py",
    ),
    Mutant(
        "storage/checksums.py",
        "zlib.crc32(np.ascontiguousarray(block).data)",
        "zlib.crc32(np.ascontiguousarray(block)[:1].data)",
        "storage/test_checksums.py",
    ),
    Mutant(
        "storage/file_locks.py",
        "            lock(descriptor)\n",
        "            pass\n",
        f"{JOB} -k one_process",
    ),
    Mutant(
        "storage/job_folder.py",
        "        if os.path.lexists(to):\n",
        "        if False:\n",
        f"{JOB} -k links_that_appear",
    ),
    Mutant(
        "storage/job_folder.py",
        "        return kept\n",
        "        return dict(layout)\n",
        f"{JOB} -k interrupted_at_every",
    ),
    Mutant(
        "storage/job_folder.py",
        '        if found.strip(b"\\0") and found != _BEGINNING[: len(found)]:\n',
        "        if False:\n",
        f"{JOB} -k file_of_another",
    ),
    # Links, locks and permissions.
    Mutant(
        "storage/own_files.py",
        "    if found.st_nlink > 1:\n",
        "    if found.st_nlink > 2:\n",
        f"{JOB} -k links_in_the_folder",
    ),
    Mutant(
        "storage/own_files.py",
        "    if os.fstat(descriptor).st_size:\n",
        "    if False:\n",
        "storage/test_outputs.py -k lock_that_is",
    ),
    Mutant(
        "storage/whole_files.py",
        "        if is_at(made, neighbour):\n",
        "        if True:\n",
        "storage/test_whole_files.py",
    ),
    Mutant(
        "storage/whole_files.py",
        "            keep_mode(file, neighbour)\n",
        "",
        "storage/test_whole_files.py",
    ),
    Mutant(
        "storage/file_locks.py",
        "        if is_at(os.fstat(descriptor), file):\n",
        "        if True:\n",
        "storage/test_file_locks.py",
    ),
    Mutant(
        "storage/outputs.py",
        "        if not (is_ours(entry.name) and entry.is_file(follow_symlinks=False)):\n",
        "        if not is_ours(entry.name):\n",
        "storage/test_outputs.py",
    ),
    Mutant(
        "storage/outputs.py",
        "    keep_mode(path, new)\n",
        "",
        "storage/test_outputs.py",
    ),
    Mutant(
        "storage/report_folder.py",
        "    if path.is_symlink():\n",
        "    if False:\n",
        "storage/test_report_folder.py",
    ),
    Mutant(
        "storage/result_store.py",
        "    if found != wanted or not complete:\n",
        "    if not complete:\n",
        "storage/test_result_store.py",
    ),
    # Fingerprints of code.
    Mutant(
        "storage/fingerprint.py",
        "for value in function.__defaults__ or ()]",
        "for value in ()]",
        FINGERPRINT,
    ),
    Mutant(
        "storage/fingerprint.py",
        "[self.of(base) for base in kind.__bases__]",
        "[]",
        FINGERPRINT,
    ),
    Mutant(
        "storage/fingerprint.py",
        "self._code_object(item) if inspect.iscode(item) else self.of(item)",
        '"code" if inspect.iscode(item) else self.of(item)',
        FINGERPRINT,
    ),
    Mutant(
        "storage/fingerprint.py",
        "sorted((self.of(item) for item in value), key=repr)",
        "[self.of(item) for item in value]",
        FINGERPRINT,
    ),
    Mutant(
        "storage/code.py",
        "            for attribute in attributes & vars(value).keys():\n",
        "            for attribute in ():\n",
        FINGERPRINT,
    ),
    # Tables of distances: where they are cut.
    Mutant(
        "geometry/pairwise.py",
        "rows[i], columns[j]",
        "rows[i], columns[i]",
        CUTS,
    ),
    Mutant(
        "geometry/pairwise.py",
        "        for start in range(0, len(in_columns), _CLOSE_BLOCK):\n",
        "        for start in range(0, min(len(in_columns), 32), _CLOSE_BLOCK):\n",
        CUTS,
    ),
    Mutant(
        "geometry/pairwise.py",
        "                        if within:\n                            result[j, i] = block.T\n",
        "                        if same:\n                            result[j, i] = block.T\n",
        CUTS,
    ),
    Mutant(
        "kernels/tiles.py",
        "zip(places, tiles, strict=True):\n",
        "zip(places[:40], tiles, strict=False):\n",
        CUTS,
    ),
    Mutant(
        "terms/normals.py",
        "        _tile(a, b, relative, a is b, squared)\n        return largest",
        "        relative = relative if len(b) <= 40 else np.ones_like(relative)\n"
        "        _tile(a, b, relative, a is b, squared)\n        return largest",
        f"{CUTS} -k more_columns",
    ),
    Mutant(
        "terms/normals.py",
        "        return largest * squared\n",
        "        return largest * squared if len(b) <= 40 else squared\n",
        f"{CUTS} -k more_columns",
    ),
    # Readers, writers and body models: what small and tidy files do not tell apart.
    Mutant(
        "surfaces/mesh_files.py",
        "                n_vertices = len(positions) // 3\n",
        '                n_vertices = content.count(b"\\nv ") + content.startswith(b"v ")\n',
        "surfaces/test_mesh_files.py -k negative_indices",
    ),
    Mutant(
        "bodies/skinned_model.py",
        "        limbs = onp.flatnonzero(self._parents >= 0)\n        feature",
        "        limbs = onp.arange(1, self.n_joints)\n        feature",
        "bodies/test_body_model.py -k written_out",
    ),
    Mutant(
        "surfaces/gltf_files.py",
        "chunk.add(normals[time] - normals[0]",
        "chunk.add(normals[time - 1] - normals[0]",
        "surfaces/test_gltf_files.py -k normals",
    ),
    Mutant(
        "storage/array_files.py",
        "needed != found or math",
        "needed > found or math",
        "storage/test_array_files.py -k beyond",
    ),
    # Starts of paths.
    Mutant(
        "solvers/basis_path.py",
        "        if energy <= turned[0][1] and np.all(metric.space.belongs(straight[1:-1])):\n",
        "        if energy <= turned[0][1]:\n",
        "solvers/test_basis_path.py -k without_area",
    ),
    # Nearest neighbours: cut-offs, blocks and rows.
    Mutant("retrieval/neighbor_search.py", "_SLACK = 1e-9\n", "_SLACK = 0.0\n", NEIGHBORS),
    Mutant("retrieval/neighbor_search.py", "_BLUR = 1e-4\n", "_BLUR = 1e-12\n", NEIGHBORS),
    Mutant(
        "retrieval/neighbor_search.py",
        "    return numbers[low <= _kth(high, k)], len",
        "    return numbers[low <= _kth(low, k)], len",
        NEIGHBORS,
    ),
    Mutant(
        "retrieval/neighbor_search.py",
        "slices(len(everyone), _DOUBLE)",
        "slices(min(len(everyone), _DOUBLE), _DOUBLE)",
        NEIGHBORS,
    ),
    Mutant(
        "retrieval/neighbor_search.py",
        "start if X is None else None)",
        "0 if X is None else None)",
        NEIGHBORS,
    ),
    Mutant(
        "retrieval/rows.py",
        "            table[: self._n_rows] = self.array\n",
        "            table[: self._n_rows - 1] = self.array[:-1]\n",
        "retrieval/test_neighbors.py -k piece_by_piece",
    ),
    Mutant(
        "retrieval/rows.py",
        "        self._n_rows = min(self._n_rows, n_rows)\n",
        "        pass\n",
        "retrieval/test_neighbors.py -k leaves_the_index",
    ),
    # Processes, caches and interrupts.
    Mutant(
        "kernels/threads.py",
        "    os.register_at_fork(after_in_child=_limit.keep_own)\n",
        "",
        "kernels/test_threads.py -k forked",
    ),
    Mutant(
        "kernels/compilation.py",
        "                self.flush()\n",
        "                pass\n",
        "kernels/test_compilation.py",
    ),
    Mutant(
        "statistics/frechet_mean.py",
        "                message = INTERRUPTED\n                break\n",
        "                message = INTERRUPTED\n",
        "solvers/test_interruption.py",
    ),
    Mutant(
        "datasets/registered_meshes.py",
        "sorted(files, key=lambda file: natural_key(file.name))",
        "sorted(files)",
        "datasets/test_registered_meshes.py",
    ),
]


def lost(mutants=MUTANTS, root=ROOT):
    """Return the mutants whose old text is not there exactly once."""
    texts = {mutant.file: root / "riemhuman" / mutant.file for mutant in mutants}
    texts = {name: file.read_text("utf-8") if file.exists() else "" for name, file in texts.items()}
    return [mutant for mutant in mutants if texts[mutant.file].count(mutant.old) != 1]


def noticed(folder: Path, mutant: Mutant, seconds: float) -> bool:
    """Make a mistake in a copy, run tests, and take it back."""
    file = folder / "riemhuman" / mutant.file
    source, times = file.read_text(encoding="utf-8"), file.stat()
    file.write_text(source.replace(mutant.old, mutant.new), encoding="utf-8")
    try:
        return _fail(folder, mutant.tests, seconds)
    finally:
        file.write_text(source, encoding="utf-8")
        os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns))


def _fail(folder: Path, tests: str, seconds: float) -> bool:
    path, *options = tests.split()
    command = [sys.executable, "-B", "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
    environment = os.environ | {
        "PYTHONPATH": str(folder),
        "NUMBA_CACHE_DIR": str(folder / "compiled"),
    }
    with subprocess.Popen(
        [*command, "-m", "not slow", f"tests/{path}", *options],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        start_new_session=True,
        text=True,
    ) as process:
        try:
            output, _ = process.communicate(timeout=seconds)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, 9)
            return True
    # A module that cannot be imported any more is noticed, too; no test to run is a mistake here.
    if process.returncode in (4, 5) and "error" not in output:
        sys.exit(f"{output}\n{tests} cannot be run")
    return process.returncode != 0


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=300.0, help="for the tests of one mistake")
    parser.add_argument("--only", nargs="*", type=int, default=[], help="numbers of mistakes")
    options = parser.parse_args()
    for mutant in lost():
        sys.stdout.write(f"LOST: {mutant.file} does not hold, once,\n{mutant.old}\n")
    if lost():
        sys.exit(1)
    chosen = [(k, m) for k, m in enumerate(MUTANTS, 1) if k in options.only or not options.only]
    n_noticed = 0
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for name in ("riemhuman", "tests"):
            shutil.copytree(
                ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__")
            )
        for name in ("setup.cfg", "README.md"):
            shutil.copy(ROOT / name, folder)
        for number, mutant in chosen:
            began = time.monotonic()
            found = noticed(folder, mutant, options.seconds)
            n_noticed += found
            sys.stdout.write(
                f"{number:3} {'noticed ' if found else 'SURVIVED'} "
                f"{time.monotonic() - began:5.0f} s  {mutant.file}: {mutant.old.strip()[:70]!r}\n"
            )
            sys.stdout.flush()
    sys.stdout.write(f"{n_noticed} of {len(chosen)} mistakes of structure were noticed\n")
    sys.exit(n_noticed < len(chosen) - 2)


if __name__ == "__main__":
    main()
