"""The results from which sections are made, and the files of their figures and tables."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray

from riemhuman.io.files import write_bytes, write_text
from riemhuman.plots import figure_files
from riemhuman.report._result_store import Computed, ResultStore
from riemhuman.report.experiments import has_pairs
from riemhuman.report.page import Picture
from riemhuman.report.plan import POSE, SHAPE, Plan, name_of
from riemhuman.report.results import Results
from riemhuman.report.tables import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from riemhuman.datasets import Bodies


@dataclass(frozen=True)
class Task:
    """A retrieval task.

    Attributes
    ----------
    name : {"shape", "pose"}
        Name of the task.
    question : str
        Question that heads its tables.
    metric : str
        The paper's metric for it.
    labels : array of int, shape (n,)
        Class of each item.
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
    """Results of a report; figures and tables are written when sections request them.

    Parameters
    ----------
    folder : Path
        Folder of the report.
    bodies : Bodies
        The bodies.
    results : Results
        Results of the experiments.
    plan : Plan
        Sizes of the experiments.
    store : ResultStore
        Store of the results, with their times.
    figures : ResultStore
        Store of the figures.
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
        """Return the tasks for which two bodies share a class.

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
        """Return the names of the person and the pose of a body.

        Parameters
        ----------
        index : int
            Number of the body.

        Returns
        -------
        str
            HTML.
        """
        return escape(name_of(self.bodies, index))

    def picture(self, name: str, alt: str, draw: Callable[..., Figure], *arguments: Any) -> Picture:
        """Write a figure, which is drawn unless the store has one of the same arguments.

        Parameters
        ----------
        name : str
            Name of the files.
        alt : str
            Description of the figure.
        draw : callable
            Function of the arguments that draws the figure.
        *arguments : object
            The bodies, steps, and other values that JSON or
            `riemhuman.report._result_store.fingerprint` can describe.

        Returns
        -------
        Picture
        """

        def compute() -> Computed:
            svg, png = figure_files(draw(*arguments))
            return {"png": np.frombuffer(png, dtype=np.uint8)}, {"svg": svg}

        given = [None if argument is self.bodies else argument for argument in arguments]
        inputs = {"draw": draw.__name__, "bodies": self.digest, "arguments": given}
        step = self.figures.step(name, inputs, compute)
        folder = self.folder / "figures"
        write_text(folder / f"{name}.svg", step.record["svg"])
        write_bytes(folder / f"{name}.png", step.arrays["png"].tobytes())
        return Picture(name, alt, step.record["svg"])

    def table(self, table: Table) -> str:
        """Write a table to its file.

        Parameters
        ----------
        table : Table
            The table.

        Returns
        -------
        str
            HTML of the table.
        """
        self.file(table)
        return table.html()

    def file(self, table: Table) -> str:
        """Write a table that is not on the page to its file.

        Parameters
        ----------
        table : Table
            The table.

        Returns
        -------
        str
            HTML of a link to the file.
        """
        write_text(self.folder / "tables" / f"{table.name}.csv", table.csv())
        return table.link()
