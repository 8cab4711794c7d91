"""The introduction and the sections of the report, in the order of the paper."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

from riemhuman.report import body_sections, path_sections
from riemhuman.report.materials import Materials
from riemhuman.report.measurement_sections import measurement_section
from riemhuman.report.page import Section, paragraph
from riemhuman.report.plan import spoken
from riemhuman.report.tables import Column, Table

if TYPE_CHECKING:
    from riemhuman.datasets import Bodies
    from riemhuman.report._result_store import Step


def sections(materials: Materials) -> list[Section]:
    """Return the sections, in the order of the paper.

    Parameters
    ----------
    materials : Materials
        Results of the report.

    Returns
    -------
    list of Section
    """
    makers = [*body_sections.SECTIONS, *path_sections.SECTIONS, measurement_section]
    made = [make(materials) for make in (*makers, body_sections.sweep_section, _making_section)]
    return [section for section in made if section is not None]


def _making_section(materials: Materials) -> Section:
    parts = [
        paragraph(
            'Versions, seeds, parameters and fingerprints are in <a href="provenance.json">'
            "provenance.json</a>; matrices, paths and maps are NumPy archives in the folder "
            "<code>results</code>. A new run of the report computes only what has changed."
        ),
        materials.table(_step_table(materials.store.steps)),
    ]
    return Section("making", "How this was made", "Making", parts)


def lead_of(bodies: Bodies, *, quick: bool) -> str:
    """Return the introduction.

    Parameters
    ----------
    bodies : Bodies
        The bodies.
    quick : bool
        Whether this is a quick report.

    Returns
    -------
    str
        HTML.
    """
    names = ", ".join(escape(spoken(name)) for name in bodies.pose_names[:3])
    text = (
        "The experiments of Pierson, Daoudi and Tumpach, <cite>A Riemannian Framework for Analysis "
        "of Human Body Surface</cite> (WACV 2022), on bodies registered to one template: "
        f"retrieval of people and of poses ({names} …), and shortest paths between bodies."
    )
    if quick:
        text += " This is a quick run, with fewer surfaces per path and fewer deformations."
    return text


def facts_of(bodies: Bodies) -> list[tuple[str, str]]:
    """Return the sizes of the data, with their names.

    Parameters
    ----------
    bodies : Bodies
        The bodies.

    Returns
    -------
    list of (str, str)
    """
    counted = {
        "bodies": len(bodies),
        "people": len(set(bodies.subject.tolist())),
        "poses": len(set(bodies.pose.tolist())),
        "vertices each": bodies.template.n_vertices,
        "pairs": len(bodies) * (len(bodies) - 1) // 2,
    }
    return [(f"{number:,}", what) for what, number in counted.items()]


def _step_table(steps: Sequence[Step]) -> Table:
    rows = [{"title": step.title, "step": step.name, "seconds": step.seconds} for step in steps]
    return Table(
        "steps",
        "Wall time of every step when it was computed.",
        (
            Column("title", "Step"),
            Column("step", "step", shown=False),
            Column("seconds", "Seconds", ".2f"),
        ),
        rows,
    )
