"""The provenance of a report: versions, machine, parameters, seeds and times."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

from riemhuman.report.plan import Plan

if TYPE_CHECKING:
    from riemhuman.datasets import Bodies
    from riemhuman.report._result_store import Step

_PACKAGES = ("numpy", "scipy", "autograd", "numba", "trimesh", "matplotlib", "scikit-learn")


def now() -> str:
    """Return the current date and time in ISO 8601, with the time zone.

    Returns
    -------
    str
    """
    return datetime.now(UTC).isoformat(timespec="seconds")


def versions() -> dict[str, str]:
    """Return the versions of Python, of this library and of its dependencies.

    Returns
    -------
    dict of str to str
    """
    found = {"python": platform.python_version()}
    for package in ("riemhuman", *_PACKAGES):
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = "from its source folder"
    return found


@cache
def identity() -> dict[str, Any]:
    """Return versions and a digest of the source code, on which all results depend.

    Returns
    -------
    dict
        Values that JSON can hold.
    """
    digest = hashlib.sha256()
    root = Path(__file__).parents[1]
    for file in sorted(root.rglob("*.py")):
        digest.update(file.relative_to(root).as_posix().encode() + file.read_bytes())
    return {"versions": versions(), "source": digest.hexdigest()}


def describe(
    bodies: Bodies, digest: str, plan: Plan, basis: str, steps: Sequence[Step], started: str
) -> dict[str, Any]:
    """Return the provenance of a report.

    Parameters
    ----------
    bodies : Bodies
        The bodies.
    digest : str
        Fingerprint of the bodies.
    plan : Plan
        Sizes and seed.
    basis : str
        Origin of the basis of deformations.
    steps : sequence of Step
        Steps of the report.
    started : str
        Time of the start.

    Returns
    -------
    dict
        Values that JSON can hold.
    """
    return {
        "started": started,
        "finished": now(),
        "versions": versions(),
        "machine": {
            "system": platform.system(),
            "processor": platform.machine(),
        },
        "bodies": {
            "number": len(bodies),
            "people": len(set(bodies.subject.tolist())),
            "poses": len(set(bodies.pose.tolist())),
            "vertices": bodies.template.n_vertices,
            "triangles": bodies.template.n_faces,
            "fingerprint": digest,
        },
        "basis": basis,
        "parameters": asdict(plan),
        "seeds": {"t-sne": plan.seed},
        "steps": [
            {
                "name": step.name,
                "seconds": step.seconds,
                "reused": step.reused,
                "fingerprint": step.fingerprint,
            }
            for step in steps
        ],
    }
