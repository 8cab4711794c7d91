"""A scan runs through the stages of its registration with little back and forth."""

from pathlib import Path

import numpy as np
import pytest
from hand_overs import files_entered
from scanned_people import settings_with

import riemhuman as rh
from riemhuman.kernels import threads
from riemhuman.registration import Scan, ScanRegistration
from riemhuman.registration._scan_preparation import PreparedScan, _LoosePoints


class OneThread:
    """What a pool of threads does, in the thread that asks for it."""

    map = staticmethod(map)

    def __init__(self, n_threads):
        pass

    def shutdown(self, **how):
        pass


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".xyz", ".ply", ".obj"])
def test_a_scan_is_handed_on_by_few_calls(model, monkeypatch, tmp_path, suffix):
    body = rh.datasets.load_open_bodies("coarse")[0]
    scan = rh.registration.simulated_scan(
        body, model.faces, rng=0, n_points=2500, rotate=False, mesh=suffix != ".xyz"
    )
    file = tmp_path / f"scan{suffix}"
    if suffix == ".xyz":
        np.savetxt(file, scan.points)
    else:
        rh.save_mesh(file, scan.points, scan.faces)
    settings = settings_with(poses=("a",), headings=(0,))
    registration = ScanRegistration(model, up="y", settings=settings)
    monkeypatch.setattr(threads, "ThreadPoolExecutor", OneThread)
    results = []

    def is_scan(value):
        is_file = isinstance(value, (str, Path)) and str(value) == str(file)
        return is_file or isinstance(value, (Scan, PreparedScan, _LoosePoints))

    files = files_entered(lambda: results.append(registration.solve(file)), is_scan)
    assert results[0].trusted, results[0].message
    listed = " → ".join(files)
    assert len(files) < 45, listed
    assert len(files) - len(set(files)) < 25, listed
