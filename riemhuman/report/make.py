"""The report: the paper's experiments on a set of bodies, in a folder with a page."""

from __future__ import annotations

import hashlib
import os
import platform
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import asdict
from datetime import UTC, datetime
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

from riemhuman.arrays import JSONRecord
from riemhuman.checks import one_of
from riemhuman.datasets import load_open_bodies
from riemhuman.errors import ArgumentError
from riemhuman.io.files import write_text
from riemhuman.measurements import open_measurements
from riemhuman.measurements.readable_units import READABLE_UNITS
from riemhuman.optional import import_matplotlib, import_optional
from riemhuman.plots import figure_style
from riemhuman.registration import read_records
from riemhuman.report._body_sections import (
    map_section,
    measurement_section,
    retrieval_section,
    sweep_section,
)
from riemhuman.report._page import Output, Section, fill, page
from riemhuman.report._path_sections import (
    comparison_section,
    difference_section,
    geodesic_section,
    mean_section,
)
from riemhuman.report._report import QUICK, Plan, Report, readable
from riemhuman.report._storage import (
    Progress,
    ResultStore,
    check_folder,
    fingerprint,
    open_folder,
    write_provenance,
)
from riemhuman.report.registered_scans import scan_section
from riemhuman.retrieval.benchmarks import of_extensions, representations, table_metrics

if TYPE_CHECKING:
    from riemhuman.datasets import Bodies
    from riemhuman.surfaces import DeformationBasis

_ONE = {"bodies": "body", "people": "person", "poses": "pose", "pairs": "pair"}
_TITLE = "Human bodies, measured by their surfaces"
_PACKAGES = ("numpy", "scipy", "autograd", "numba", "trimesh", "matplotlib", "scikit-learn")

# In the order of the paper; each returns None if the bodies or their labels do not allow it.
_SECTIONS = (
    retrieval_section,
    map_section,
    difference_section,
    geodesic_section,
    comparison_section,
    mean_section,
    measurement_section,
    sweep_section,
)


def make_report(
    output: str | os.PathLike[str],
    *,
    bodies: Bodies | None = None,
    basis: DeformationBasis | None = None,
    quick: bool = False,
    scans: str | os.PathLike[str] | None = None,
    units: str = "cm",
    progress: Progress = nullcontext,
) -> Path:
    """Repeat the experiments of the paper's sections 5 and 6, and write a report.

    The folder contains ``index.html``, a page that needs no network connection, the figures as SVG
    and PNG, the tables as CSV, the results as .npz archives and ``provenance.json``. A new run
    computes only what has changed, and an interrupted run continues.

    Parameters
    ----------
    output : path_like
        The folder: new, empty, or with an earlier report.
    bodies : Bodies, optional
        Registered bodies; by default the open bodies, at full resolution or, if `quick`, coarse.
        Those whose `pose_names` are empty texts are of unknown people and poses. Sections appear
        where they say something: measurements of one body of the open model, differences and paths
        of two bodies, means and retrieval of more whose labels allow it.
    basis : DeformationBasis, optional
        Deformations for geodesics and means; by default the principal components of the open
        motions for the open bodies, mesh harmonics for others.
    quick : bool
        Whether to write a smaller report, in half a minute instead of minutes.
    scans : path_like, optional
        Output folder of `riemhuman.registration.register_folder`; the page shows its scans, the
        worst first.
    units : {"cm", "in"}
        Units of the page: centimetres, kilograms and litres, or inches and pounds; tables in CSV
        files are in SI units.
    progress : callable
        Takes the name of a task; returns a context manager that is open during the task.

    Examples
    --------
    >>> page = rh.report.make_report("report", quick=True)  # doctest: +SKIP
    """
    one_of(units, "units", tuple(READABLE_UNITS))
    check_folder(output)
    import_matplotlib(extra="report")
    import_optional("sklearn.manifold", "report")
    started = _now()
    bodies = _bodies_to_report(bodies, basis, quick, progress)
    compared = {**table_metrics(bodies), **(of_extensions if quick else representations)(bodies)}
    first = [] if scans is None else [scan_section(read_records(scans), units=units)]
    folder = open_folder(output)
    digest, results = fingerprint(bodies), folder / "results"
    common = {**_identity(), "bodies": digest}
    store = ResultStore(results, common, progress)
    plan = QUICK if quick else Plan()
    figures = ResultStore(results / "figures", common, progress)
    files = Output(folder, figures, plan.dots_an_inch)
    report = Report(bodies, plan, store, files, compared, basis, units)
    with figure_style():
        has_retrieval = any(task.is_retrieval for task in report.tasks)
        # With few scans, people want measurements first.
        order = _SECTIONS if has_retrieval else sorted(_SECTIONS, key=_comes_later)
        made = [section for make in order if (section := make(report)) is not None]
    sizes = _sizes(report)
    steps = _rows_of_steps(store)
    making = fill("making", steps=files.table("steps", steps))
    lead = fill(
        "lead",
        poses=[readable(name) for name in bodies.pose_names[:3]],
        quick=quick,
        has_retrieval=has_retrieval,
        has_poses=report.has_poses,
        count=len(bodies),
    )
    text = page(
        _TITLE,
        lead,
        [
            (f"{number:,}", _ONE.get(name, name) if number == 1 else name)
            for name, number in sizes.items()
        ],
        [*first, *made, Section("making", "How this was made", "Making", making)],
        f"Made with riemhuman {_versions()['riemhuman']}, {_now()}. "
        "Bodies in 3-D are drawn by three.js (MIT licence).",
    )
    write_text(folder / "index.html", text)
    made_how = {"started": started, "sizes": sizes, "fingerprint": digest, "steps": steps}
    write_provenance(folder, _provenance(report, plan, made_how))
    return folder / "index.html"


def _provenance(report: Report, plan: Plan, made_how: JSONRecord) -> JSONRecord:
    """Return what a finished report says of itself, in the order of its file."""
    return {
        "status": "finished",
        "started": made_how["started"],
        "finished": _now(),
        "versions": _versions(),
        "machine": {"system": platform.system(), "processor": platform.machine()},
        "sizes": made_how["sizes"],
        "fingerprint": made_how["fingerprint"],
        "basis": report.basis[1],
        "parameters": asdict(plan),
        "seeds": {"t-sne": plan.seed},
        "steps": made_how["steps"],
    }


def _rows_of_steps(store: ResultStore) -> list[JSONRecord]:
    """Return the steps of the experiments; figures, which have a store of their own, are none."""
    return [
        {"title": s.title, "step": s.name, "seconds": s.seconds}
        | {"reused": s.is_reused, "fingerprint": s.fingerprint}
        for s in store.steps
    ]


def _bodies_to_report(
    bodies: Bodies | None, basis: DeformationBasis | None, quick: bool, progress: Progress
) -> Bodies:
    """Return the bodies, by default the open ones; there must be enough, and the basis must fit."""
    if bodies is None:
        with progress("Loading the bodies"):
            bodies = load_open_bodies("coarse" if quick else "full")
    if len(bodies) < 2 and (not len(bodies) or open_measurements(bodies.template) is None):
        raise ArgumentError(
            "bodies must be at least two, or one of the open body model, which is measured; found "
            f"{len(bodies)}"
        )
    if basis is not None:
        basis.check_fits(bodies.template)
    return bodies


def _comes_later(make: Callable[[Report], Section | None]) -> bool:
    return make is not measurement_section


def _sizes(report: Report) -> dict[str, int]:
    bodies = report.bodies
    labelled = {
        "people": len(set(bodies.subject.tolist())),
        "poses": len(set(bodies.pose.tolist())),
    }
    return {
        "bodies": len(bodies),
        **(labelled if report.has_poses else {}),
        "vertices each": bodies.template.n_vertices,
        **({"pairs": len(bodies) * (len(bodies) - 1) // 2} if len(bodies) > 1 else {}),
    }


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


@cache
def _versions() -> dict[str, str]:
    """Return the versions of Python, of this library and of its dependencies."""
    versions = {"python": platform.python_version()}
    for package in ("riemhuman", *_PACKAGES):
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            versions[package] = "from its source folder"
    return versions


@cache
def _identity() -> JSONRecord:
    """Return versions and a digest of the source code, on which all results depend."""
    digest = hashlib.sha256()
    root = Path(__file__).parents[1]
    for file in sorted(root.rglob("*.py")):
        digest.update(file.relative_to(root).as_posix().encode() + file.read_bytes())
    return {"versions": _versions(), "source": digest.hexdigest()}
