"""What lower floors use of higher ones: handed down by `riemhuman` itself, never imported.

A metric without solvers takes default ones, and results draw themselves in notebooks; solvers and
plots are above them. `riemhuman/__init__.py`, which stands above all floors, says where they are,
and they are loaded when they are first used.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

if TYPE_CHECKING:
    from numpy import ndarray

T = TypeVar("T")


class DefaultSolvers(Protocol):
    """Strategies of a metric that was given none, see `riemhuman.solvers.defaults`."""

    def geodesic_solver(self, metric: Any) -> Any: ...

    def exp_solver(self, metric: Any) -> Any: ...

    def log_solver(self, metric: Any) -> Any: ...

    def transport_solver(self, metric: Any) -> Any: ...


class NotebookPictures(Protocol):
    """Pictures of surfaces as HTML, see `riemhuman.plots`."""

    def surfaces_html(
        self, surfaces: Sequence[ndarray] | ndarray, faces: ndarray | None, caption: str
    ) -> str: ...


class Provided(Generic[T]):
    """Something of a higher floor, loaded when it is first used."""

    def __init__(self) -> None:
        self._load: Callable[[], T] | None = None

    def load_by(self, load: Callable[[], T]) -> None:
        """Say how it is loaded."""
        self._load = load

    def __call__(self) -> T:
        if self._load is None:
            raise RuntimeError("riemhuman/__init__.py provides this, and was not run")
        return self._load()


default_solvers: Provided[DefaultSolvers] = Provided()
notebook_pictures: Provided[NotebookPictures] = Provided()
