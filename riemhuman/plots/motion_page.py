"""A page that plays two time-aligned motions, with their re-timing and matched frames."""

from __future__ import annotations

import base64
import os
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from string import Template

import numpy as np
from numpy import ndarray

from riemhuman.checks import real_array
from riemhuman.errors import ArgumentError
from riemhuman.io.files import write_text
from riemhuman.motions.warp import Warp
from riemhuman.plots.viewer import view_path
from riemhuman.plots.web_files import scripts, styles, web_file
from riemhuman.surfaces.html_pictures import png_bytes, strip_picture
from riemhuman.surfaces.rendering import SKIN, View

_MATCHES = 8
_STRIP_HEIGHT = 200


@dataclass(frozen=True)
class AlignedMotions:
    """Two motions, the second aligned in time with the first.

    Attributes
    ----------
    first, second : array, shape (n_times, V, 3)
        The motions at corresponding times, metres, y up.
    faces : array of int, shape (F, 3)
        Triangles.
    warp : Warp
        The matched times of both motions.
    names : sequence of str
        Names of the motions.

    Examples
    --------
    >>> import riemhuman as rh
    >>> knees, other = rh.datasets.load_open_motions("coarse", sequences="knees")[:2]
    >>> pose = rh.ElasticMetric(rh.AlignedSurfaces(knees.template), a=0.0, lam=0.0, c=1.0)
    >>> m1, m2 = knees[:40:8], other[:40:8]
    >>> warp = rh.motions.DynamicTimeWarping(pose).warp(m1, m2)
    >>> aligned = rh.plots.AlignedMotions(m1, m2[warp(range(5)).round().astype(int)],
    ...                                    knees.faces, warp)
    >>> aligned.save("aligned.html")
    """

    first: ndarray
    second: ndarray
    faces: ndarray
    warp: Warp
    names: Sequence[str] = ("first", "second")

    def __post_init__(self) -> None:
        for name in ("first", "second"):
            real_array(getattr(self, name), name, ("n_times", "n_vertices", 3), batched=False)
        if self.first.shape != self.second.shape:
            raise ArgumentError(
                f"second must have the shape of first, {self.first.shape}; found "
                f"{self.second.shape}"
            )

    def page(self) -> str:
        """Return the self-contained HTML page.

        Returns
        -------
        str
        """
        names = [escape(name) for name in self.names]
        paths = dict(zip(self.names, self._placed(), strict=True))
        viewer = view_path(paths, self.faces, side_by_side=True, title=" and ".join(self.names))
        return Template(web_file("motion_page.html")).substitute(
            first=names[0],
            second=names[1],
            styles=styles(),
            viewer=viewer.fragment("motions"),
            distance=f"{self.warp.dist:.4g}",
            curve=self._curve(),
            strips=self._strips(),
            n_matches=min(_MATCHES, len(self.first)),
            end=scripts(),
        )

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the page to a file for any browser, without a network connection.

        Parameters
        ----------
        path : path_like
            The file; an existing file is replaced.

        Raises
        ------
        FileError
            If the file cannot be written.
        """
        write_text(path, self.page())

    def _placed(self) -> list[ndarray]:
        """Return both motions with their first frames at the same place."""
        return [
            m - m[0].mean(axis=0) * np.array([1.0, 0.0, 1.0]) for m in (self.first, self.second)
        ]

    def _curve(self) -> str:
        """Return the points of the re-timing in a square of side 100, for an SVG polyline."""
        scales = [max(float(times[-1]), 1.0) for times in (self.warp.first, self.warp.second)]
        x, y = self.warp.first / scales[0], self.warp.second / scales[1]
        return " ".join(f"{100 * a:.2f},{100 - 100 * b:.2f}" for a, b in zip(x, y, strict=True))

    def _strips(self) -> str:
        """Return pictures of pairs of corresponding frames."""
        places = np.linspace(0, len(self.first) - 1, min(_MATCHES, len(self.first)))
        pairs = []
        for k in places.round().astype(int):
            surfaces = [motion[k] for motion in self._placed()]
            picture = strip_picture(surfaces, self.faces, [SKIN, SKIN], View(), _STRIP_HEIGHT)
            code = base64.b64encode(png_bytes(picture)).decode("ascii")
            share = f"{100 * k / (len(self.first) - 1):.0f} %"
            pairs.append(
                f'<figure><img src="data:image/png;base64,{code}" alt="Both at {share}">'
                f"<figcaption>{share}</figcaption></figure>"
            )
        return "\n".join(pairs)
