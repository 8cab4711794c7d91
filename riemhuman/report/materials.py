"""What the sections of a report are made from, and where their figures and tables go."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray

from riemhuman.plots.figures import Picture, drawn
from riemhuman.report.experiments import has_pairs
from riemhuman.report.plan import POSE, SHAPE, Plan, name_of
from riemhuman.report.results import Results
from riemhuman.report.tables import Table
from riemhuman.storage.result_store import Computed, ResultStore
from riemhuman.storage.whole_files import write_bytes, write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from riemhuman.datasets import Bodies


@dataclass(frozen=True)
class Task:
    """What is retrieved.

    Attributes
    ----------
    name : {"shape", "pose"}
        Its name.
    question : str
        What is asked.
    metric : str
        The paper's metric for it.
    labels : array of int, shape (n,)
        Classes.
    names : tuple of str
        Names of the classes.
    """

    name: str
    question: str
    metric: str
    labels: ndarray
    names: tuple[str, ...]


@dataclass(frozen=True)
class Materials:
    """Results of a report; figures and tables are written as sections ask for them.

    Parameters
    ----------
    folder : Path
        Folder of the report.
    bodies : Bodies
        The bodies.
    results : Results
        What was computed.
    plan : Plan
        Sizes.
    store : ResultStore
        Steps and their times.
    figures : ResultStore
        Where figures are kept.
    digest : str
        Fingerprint of the bodies.
    """

    folder: Path
    bodies: Bodies
    results: Results
    plan: Plan
    store: ResultStore
    figures: ResultStore
    digest: str

    def tasks(self) -> list[Task]:
        """Return what can be retrieved: people, poses, or neither.

        Returns
        -------
        list of Task
        """
        bodies = self.bodies
        both = [
            Task("shape", "Who is it?", SHAPE, bodies.subject, bodies.subject_names),
            Task("pose", "How do they stand?", POSE, bodies.pose, bodies.pose_names),
        ]
        return [task for task in both if has_pairs(task.labels)]

    def name(self, index: int) -> str:
        """Return the person and the pose of a body, in words.

        Parameters
        ----------
        index : int
            Which body.

        Returns
        -------
        str
            HTML.
        """
        return escape(name_of(self.bodies, index))

    def picture(self, name: str, alt: str, draw: Callable[..., Figure], *arguments: Any) -> Picture:
        """Write a figure, drawn unless that of the same arguments is kept.

        Parameters
        ----------
        name : str
            Name of its files.
        alt : str
            What it shows.
        draw : callable
            Draws it from the arguments.
        *arguments : object
            The bodies, steps, and what else JSON and
            `riemhuman.storage.result_store.fingerprint` know.

        Returns
        -------
        Picture
        """

        def compute() -> Computed:
            svg, png = drawn(draw(*arguments))
            return {"png": np.frombuffer(png, dtype=np.uint8)}, {"svg": svg}

        given = [None if argument is self.bodies else argument for argument in arguments]
        inputs = {"draw": draw.__name__, "bodies": self.digest, "arguments": given}
        step = self.figures.step(name, inputs, compute)
        folder = self.folder / "figures"
        write_text(folder / f"{name}.svg", step.record["svg"])
        write_bytes(folder / f"{name}.png", step.arrays["png"].tobytes())
        return Picture(name, alt, step.record["svg"])

    def table(self, table: Table) -> str:
        """Write a table.

        Parameters
        ----------
        table : Table
            The table.

        Returns
        -------
        str
            Its HTML.
        """
        self.file(table)
        return table.html()

    def file(self, table: Table) -> str:
        """Write a table that is not on the page.

        Parameters
        ----------
        table : Table
            The table.

        Returns
        -------
        str
            HTML of a link to it.
        """
        write_text(self.folder / "tables" / f"{table.name}.csv", table.csv())
        return table.link()
