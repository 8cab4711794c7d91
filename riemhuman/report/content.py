"""The sections of the report, in the order of the paper, and what stands above them."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from riemhuman.report import report_tables
from riemhuman.report.body_sections import map_section, retrieval_section, sweep_section
from riemhuman.report.materials import Materials
from riemhuman.report.measurement_sections import measurement_section
from riemhuman.report.page import Section, paragraph
from riemhuman.report.path_sections import (
    comparison_section,
    difference_section,
    geodesic_section,
    mean_section,
)
from riemhuman.report.plan import spoken

if TYPE_CHECKING:
    from riemhuman.datasets import Bodies


def sections(materials: Materials) -> list[Section]:
    """Return the sections, in the order of the paper.

    Parameters
    ----------
    materials : Materials
        Results, and where figures and tables go.

    Returns
    -------
    list of Section
    """
    made = [
        retrieval_section(materials),
        map_section(materials),
        difference_section(materials),
        geodesic_section(materials),
        comparison_section(materials),
        mean_section(materials),
        measurement_section(materials),
        sweep_section(materials),
        making_section(materials),
    ]
    return [section for section in made if section is not None]


def making_section(materials: Materials) -> Section:
    """Return the section about how the report was made.

    Parameters
    ----------
    materials : Materials
        Results, and where figures and tables go.

    Returns
    -------
    Section
    """
    parts = [
        paragraph(
            'Versions, seeds, parameters and fingerprints are in <a href="provenance.json">'
            "provenance.json</a>; matrices, paths and maps are NumPy archives in the folder "
            "<code>results</code>. Running the report again computes only what has changed."
        ),
        materials.table(report_tables.step_table(materials.store.steps)),
    ]
    return Section("making", "How this was made", "Making", parts)


def lead_of(bodies: Bodies, *, quick: bool) -> str:
    """Return the first paragraph.

    Parameters
    ----------
    bodies : Bodies
        The bodies.
    quick : bool
        Whether the report is a quick one.

    Returns
    -------
    str
        HTML.
    """
    names = ", ".join(escape(spoken(name)) for name in bodies.pose_names[:3])
    text = (
        "The experiments of Pierson, Daoudi and Tumpach, <cite>A Riemannian Framework for Analysis "
        "of Human Body Surface</cite> (WACV 2022), on bodies registered to one template: "
        f"who they are, how they stand ({names} …), and the shortest ways from one to another."
    )
    if quick:
        text += " A quick run: fewer surfaces a path and fewer deformations than a full one."
    return text


def facts_of(bodies: Bodies) -> list[tuple[str, str]]:
    """Return numbers of the data, and what they count.

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
