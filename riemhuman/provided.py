"""What lower layers use from higher ones: provided by `riemhuman` itself, never imported.

A metric without solvers uses default ones, and results draw themselves in notebooks, but solvers
and plots are in higher layers. `riemhuman/__init__.py`, above all layers, says where they are, and
they are loaded on first use.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from types import ModuleType
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

if TYPE_CHECKING:
    from riemhuman.arrays import Points, Triangles

T = TypeVar("T")


class View(Protocol):
    """An interactive view, see `riemhuman.plots.Viewer`."""

    def save(self, path: str | os.PathLike[str]) -> None: ...


class NotebookPictures(Protocol):
    """Pictures of surfaces as HTML and views, see `riemhuman.plots`."""

    def surfaces_html(
        self, surfaces: Sequence[Points] | Points, faces: Triangles | None, caption: str
    ) -> str: ...

    def view(self, shown: object) -> View: ...


class Provided(Generic[T]):
    """Something of a higher floor, loaded when it is first used."""

    _load: Callable[[], T]

    def load_by(self, load: Callable[[], T]) -> None:
        """Say how it is loaded."""
        self._load = load

    def __call__(self) -> T:
        return self._load()


# Their type is `riemhuman.geometry.metric.DefaultSolvers`, which names metrics and strategies.
default_solvers: Provided[object] = Provided()
notebook_pictures: Provided[NotebookPictures] = Provided()
# `riemhuman.topologies`, two of whose names are also found in `riemhuman.registration`.
topologies: Provided[ModuleType] = Provided()
