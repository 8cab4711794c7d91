"""Panels of pages: drawings on bodies, with controls beside them."""

from __future__ import annotations

from abc import ABC, abstractmethod

from markupsafe import Markup

from riemhuman.arrays import Image


class Panel(ABC):
    """Something drawn on the bodies of a page, with controls beside them, see `Viewer`."""

    name: str
    """The name of its class in ``PANELS`` of the script."""

    @abstractmethod
    def data(self) -> dict[str, object]:
        """Return what the script needs, in types that JSON can hold."""

    @abstractmethod
    def html(self, identifier: str) -> Markup:
        """Return the controls, whose identifiers begin with that of the viewer."""

    def picture(self, height: int) -> Image | None:
        """Return the picture shown without WebGL, shape (height, width, 4).

        None if it is that of the bodies themselves.
        """
        return None
