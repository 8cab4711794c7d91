"""The report: the paper's experiments on a set of bodies, in a folder with a page."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from riemhuman.datasets import load_open_bodies
from riemhuman.errors import ArgumentError
from riemhuman.geometry import AlignedSurfaces
from riemhuman.io.files import write_text
from riemhuman.optional import import_optional
from riemhuman.plots._figures import figure_style
from riemhuman.registration.folders import read_records
from riemhuman.report import provenance
from riemhuman.report._folder import check_folder, opened_folder, write_provenance
from riemhuman.report._result_store import Progress, ResultStore, fingerprint
from riemhuman.report.content import facts_of, lead_of, sections
from riemhuman.report.materials import Materials
from riemhuman.report.page import Section, page
from riemhuman.report.plan import QUICK, Plan
from riemhuman.report.registered_scans import scan_section
from riemhuman.report.representations import available, of_extensions
from riemhuman.report.results import compute_results
from riemhuman.report.retrieval_benchmark import table_metrics

if TYPE_CHECKING:
    from riemhuman.datasets import Bodies
    from riemhuman.surfaces.deformation_basis import DeformationBasis

_TITLE = "Human bodies, measured by their surfaces"


def make_report(
    output: str | os.PathLike[str],
    *,
    bodies: Bodies | None = None,
    basis: DeformationBasis | None = None,
    quick: bool = False,
    representations: Mapping[str, Any] | None = None,
    scans: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
    bars: bool = False,
) -> Path:
    """Repeat the experiments of the paper's sections 5 and 6, and write a report.

    The folder contains ``index.html``, a page for any browser without a network connection, the
    figures as SVG and PNG, the tables as CSV, the results as .npz archives and ``provenance.json``.
    A new run computes only what has changed, and an interrupted run continues.

    Parameters
    ----------
    output : path_like
        The folder: new, empty, or of an earlier report.
    bodies : Bodies, optional
        At least three registered bodies with known people and poses; by default the open bodies,
        at full resolution or, if `quick`, coarse.
    basis : DeformationBasis, optional
        Deformations for geodesics and means; by default the principal components of the open
        motions for the open bodies, mesh harmonics for others.
    quick : bool
        Whether to make a smaller report, in half a minute instead of minutes.
    representations : mapping of str to object, optional
        Further metrics and descriptors of the retrieval tables, as for
        `riemhuman.report.benchmark`; by default all that apply to the bodies or, if `quick`,
        only those of other packages, see `riemhuman.extensions`.
    scans : path_like, optional
        Output folder of `riemhuman.registration.register_folder`; the page shows its scans, the
        worst first.
    progress : callable, optional
        Takes the name of a task; returns a context manager that is open during the task.
    bars : bool
        Whether to show progress bars within long tasks.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    FileError
        If the folder holds other files, cannot be written, or another process is using it.
    MissingDependencyError
        If matplotlib or scikit-learn is not installed.
    ArgumentError
        If there are fewer than three bodies, or the basis does not fit them.

    Examples
    --------
    >>> import riemhuman as rh
    >>> page = rh.report.make_report("report", quick=True)  # doctest: +SKIP
    """
    check_folder(output)
    import_optional("matplotlib", "report")
    import_optional("sklearn.manifold", "report")
    begun = provenance.now()
    watch: Progress = progress or (lambda name: nullcontext())
    if bodies is None:
        with watch("Loading the bodies"):
            bodies = load_open_bodies("coarse" if quick else "full")
    if len(bodies) < 3:
        raise ArgumentError(f"bodies must be at least 3; found {len(bodies)}")
    if basis is not None:
        basis.check_fits(bodies.template)
    shown = [] if scans is None else [scan_section(read_records(scans))]
    with opened_folder(output) as folder:
        return _make(folder, bodies, basis, quick, representations, shown, watch, bars, begun)


def _make(
    folder: Path,
    bodies: Bodies,
    basis: DeformationBasis | None,
    quick: bool,
    representations: Mapping[str, Any] | None,
    shown: list[Section],
    watch: Progress,
    bars: bool,
    begun: str,
) -> Path:
    plan = QUICK if quick else Plan()
    space = AlignedSurfaces(bodies.template, equip=False)
    digest = fingerprint(
        [bodies.points, bodies.template.vertices, bodies.template.faces]
        + [bodies.subject, bodies.pose, bodies.subject_names, bodies.pose_names]
    )
    identity = provenance.identity()
    store = ResultStore(folder / "results", identity, watch)
    figures = ResultStore(folder / "results" / "figures", identity)
    if representations is None:
        representations = of_extensions(bodies) if quick else available(bodies)
    compared = {**table_metrics(bodies), **representations}
    results = compute_results(store, digest, bodies, space, plan, basis, compared, bars=bars)

    with watch("Page and figures"), figure_style():
        materials = Materials(folder, bodies, results, plan, store, figures, digest)
        text = page(
            _TITLE,
            lead_of(bodies, quick=quick),
            facts_of(bodies),
            [*shown, *sections(materials)],
            f"Made with riemhuman {provenance.versions()['riemhuman']}, {provenance.now()}. "
            "Bodies in 3-D are drawn by three.js (MIT licence).",
        )
        write_text(folder / "index.html", text)
    described = provenance.describe(bodies, digest, plan, results.basis, store.steps, begun)
    write_provenance(folder, {"status": "finished", **described})
    return folder / "index.html"
