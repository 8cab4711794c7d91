"""The report: the paper's experiments on a set of bodies, in a folder with a page."""

from __future__ import annotations

import hashlib
import os
import platform
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import asdict
from datetime import UTC, datetime
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

from riemhuman.arrays import JSONRecord
from riemhuman.checks import a_basis, checked, choice, flag, instance
from riemhuman.datasets import Bodies, load_open_bodies
from riemhuman.errors import ArgumentError
from riemhuman.io.files import write_text
from riemhuman.measurements import open_measurements
from riemhuman.optional import import_matplotlib, import_optional
from riemhuman.plots import figure_style
from riemhuman.readable_units import READABLE_UNITS
from riemhuman.registration import read_records
from riemhuman.report._body_sections import (
    map_section,
    measurement_section,
    retrieval_section,
    sweep_section,
)
from riemhuman.report._page import Output, Section, fill, library_version, page
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


@checked(
    bodies=instance(Bodies, "Bodies, such as rh.datasets.load_faust returns"),
    basis=a_basis,
    quick=flag,
    units=choice(*READABLE_UNITS),
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
    draws all figures, but computes only results that have changed; an interrupted run continues.

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
    check_folder(output)
    import_matplotlib(extra="report")
    import_optional("sklearn.manifold", "report")
    started = _now()
    bodies = _bodies_to_report(bodies, basis, quick, progress)
    compared = table_metrics(bodies) | of_extensions(bodies) if quick else representations(bodies)
    sections = [] if scans is None else [scan_section(read_records(scans), units=units)]
    folder = open_folder(output)
    digest = fingerprint(bodies)
    common = {**_identity(), "bodies": digest}
    store = ResultStore(folder / "results", common, progress)
    plan = QUICK if quick else Plan()
    files = Output(folder, plan.dots_an_inch, progress)
    report = Report(bodies, plan, store, files, compared, basis, units)
    sections += _sections_of(report)
    steps = _rows_of_steps(store)
    making = fill("making", steps=files.table("steps", steps))
    sections.append(Section("making", "How this was made", "Making", making))
    write_text(folder / "index.html", _page_text(report, sections, quick=quick))
    write_provenance(
        folder,
        {
            "status": "finished",
            "started": started,
            "finished": _now(),
            "versions": _versions(),
            "machine": {"system": platform.system(), "processor": platform.machine()},
            "sizes": _sizes(report),
            "fingerprint": digest,
            "basis": report.basis[1],
            "parameters": asdict(plan),
            "seeds": {"t-sne": plan.seed},
            "steps": steps,
        },
    )
    return folder / "index.html"


def _sections_of(report: Report) -> list[Section]:
    """Return the sections for which there are enough bodies and labels."""
    makers = list(_SECTIONS)
    if not report.has_retrieval:
        # With few scans, people want measurements first.
        makers.remove(measurement_section)
        makers.insert(0, measurement_section)
    with figure_style():
        sections = [maker(report) for maker in makers]
    return [section for section in sections if section is not None]


def _page_text(report: Report, sections: Sequence[Section], *, quick: bool) -> str:
    bodies = report.bodies
    lead = fill(
        "lead",
        poses=[readable(name) for name in bodies.pose_names[:3]],
        quick=quick,
        has_retrieval=report.has_retrieval,
        has_poses=report.has_poses,
        count=len(bodies),
    )
    facts = []
    for name, number in _sizes(report).items():
        facts.append((f"{number:,}", _ONE.get(name, name) if number == 1 else name))
    end = (
        f"Made with riemhuman {library_version()}, {_now()}. "
        "Bodies in 3-D are drawn by three.js (MIT licence)."
    )
    return page(_TITLE, lead, facts, sections, end)


def _rows_of_steps(store: ResultStore) -> list[JSONRecord]:
    """Return the steps of the experiments."""
    return [
        {
            "title": step.title,
            "step": step.name,
            "seconds": step.seconds,
            "reused": step.is_reused,
            "fingerprint": step.fingerprint,
        }
        for step in store.steps
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


def _sizes(report: Report) -> dict[str, int]:
    bodies = report.bodies
    sizes = {"bodies": len(bodies)}
    if report.has_poses:
        sizes["people"] = len(set(bodies.subject.tolist()))
        sizes["poses"] = len(set(bodies.pose.tolist()))
    sizes["vertices each"] = bodies.template.n_vertices
    if len(bodies) > 1:
        sizes["pairs"] = len(bodies) * (len(bodies) - 1) // 2
    return sizes


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


@cache
def _versions() -> dict[str, str]:
    """Return the versions of Python, of this library and of its dependencies."""
    versions = {"python": platform.python_version(), "riemhuman": library_version()}
    return versions | {package: metadata.version(package) for package in _PACKAGES}


@cache
def _identity() -> JSONRecord:
    """Return versions and a digest of the source code, on which all results depend."""
    digest = hashlib.sha256()
    root = Path(__file__).parents[1]
    for file in sorted(root.rglob("*.py")):
        digest.update(file.relative_to(root).as_posix().encode() + file.read_bytes())
    return {"versions": _versions(), "source": digest.hexdigest()}
