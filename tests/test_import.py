"""`import riemhuman` is light, needs no network and offers every name it lists."""

import subprocess
import sys

import pytest

import riemhuman

HEAVY = {"dask", "h5py", "matplotlib", "numba", "torch", "trimesh"}

REFUSE_NETWORK = """
import sys

def refuse_network(event, arguments):
    if event.startswith("socket."):
        raise RuntimeError(f"network used: {event} {arguments}")

sys.addaudithook(refuse_network)
"""


def run(code):
    """Run code in a fresh interpreter, with warnings as errors and without a network."""
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", REFUSE_NETWORK + code],
        capture_output=True,
        encoding="utf-8",
    )


def test_import_loads_nothing_heavy():
    result = run(f"import riemhuman; print(*sorted({HEAVY} & sys.modules.keys()))")
    assert result.returncode == 0, result.stderr
    assert result.stdout.split() == []


def test_network_guard_can_fail():
    result = run("import socket; socket.create_connection(('127.0.0.1', 9))")
    assert "network used" in result.stderr


def test_public_names_are_listed_once_and_visible():
    assert len(set(riemhuman.__all__)) == len(riemhuman.__all__)
    assert dir(riemhuman) == sorted(riemhuman.__all__)


def test_packages_show_public_names_only():
    members = [getattr(riemhuman, name) for name in riemhuman.__all__]
    packages = [member for member in members if {"__path__", "__dir__"} <= vars(member).keys()]
    assert len(packages) > 10
    for package in packages:
        assert dir(package) == sorted(package.__all__)
        assert all(hasattr(package, name) for name in package.__all__)


def test_unknown_name_is_refused():
    with pytest.raises(AttributeError, match="no_such_name"):
        riemhuman.no_such_name  # noqa: B018


@pytest.mark.slow
def test_commands_import_what_they_use():
    """Parts of SciPy that take long to import are imported when something needs them."""
    late = {f"scipy.{name}" for name in ("interpolate", "ndimage", "optimize", "signal", "stats")}
    result = run(
        "import riemhuman as rh\n"
        "rh.bodies, rh.datasets, rh.measurements, rh.motions, rh.registration, rh.retrieval\n"
        "rh.solvers\n"
        f"print(*sorted({late | HEAVY} & sys.modules.keys()))"
    )
    assert result.returncode == 0, result.stderr
    assert result.stdout.split() == []
