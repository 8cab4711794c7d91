"""Learned codes as descriptors, for comparison with metrics in retrieval tables."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.checks import one_of
from riemhuman.descriptors import Descriptor
from riemhuman.errors import ArgumentError
from riemhuman.learned.intrinsic_extrinsic_codes import IntrinsicExtrinsicCodes
from riemhuman.learned.shape_pose_codes import ShapePoseCodes
from riemhuman.surfaces.template import Template

LEARNED = ", trained here"
"""Ending of the names of learned codes in tables."""


@dataclass(frozen=True, eq=False)
class CodeDescriptor(Descriptor):
    """One of the two codes that a network computes for a body.

    The distance is Euclidean.

    Parameters
    ----------
    codes : ShapePoseCodes or IntrinsicExtrinsicCodes
        A trained network.
    which : {"shape", "pose", "intrinsic", "extrinsic"}
        Name of the code.

    Raises
    ------
    ArgumentError
        If the network has no such code.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> codes = rh.learned.ShapePoseCodes.load_pretrained()
    >>> rh.report.CodeDescriptor(codes, "shape").describe_all(bodies[:2]).shape
    (2, 16)
    """

    codes: ShapePoseCodes | IntrinsicExtrinsicCodes
    which: str

    def __post_init__(self) -> None:
        one_of(self.which, "which", self.codes.code_names)

    def describe(self, vertices: ArrayLike, faces: ArrayLike) -> np.ndarray:
        """Return the code of one surface.

        Parameters
        ----------
        vertices : array_like, shape (V, 3)
            Vertex positions, metres.
        faces : array_like, shape (F, 3)
            Triangles; shape and pose codes require those of the network's template.

        Raises
        ------
        ArgumentError
            If a shape or pose code is requested and the surface is not registered.
        """
        if isinstance(self.codes, IntrinsicExtrinsicCodes):
            return self._half(self.codes.describe(vertices, faces)[None])[0]
        template = self.codes.template_
        template.check_faces(faces)
        return self._half(self.codes.transform(np.asarray(vertices)[None]))[0]

    def describe_all(self, bodies: Any, n_jobs: int | None = None) -> np.ndarray:
        """Return the codes of many surfaces.

        Parameters
        ----------
        bodies : object or iterable of (vertices, faces)
            Registered surfaces with the fields ``points`` and ``template``, which must be in
            correspondence with the network's own; or meshes.
        n_jobs : int, optional
            Number of threads for meshes, -1 for one per core; by default one.

        Raises
        ------
        ArgumentError
            If the template is not in correspondence.
        """
        template = getattr(bodies, "template", None)
        if not isinstance(template, Template):
            return super().describe_all(bodies, n_jobs)
        known = self.codes.template_
        same = known.n_vertices == template.n_vertices and np.array_equal(
            known.faces, template.faces
        )
        codes = self.codes if same else self.codes.on(template)
        return self._half(codes.transform(bodies.points))

    def _half(self, found: np.ndarray) -> np.ndarray:
        return self.codes.split(found)[self.codes.code_names.index(self.which)]


def shipped_descriptors(template: Template) -> dict[str, CodeDescriptor]:
    """Return the codes of the networks that ship, for tables."""
    clouds = IntrinsicExtrinsicCodes.load_pretrained(template)
    found = {
        f"{which} code{LEARNED}": CodeDescriptor(clouds, which)
        for which in ("intrinsic", "extrinsic")
    }
    try:
        parts = ShapePoseCodes.load_pretrained(template)
    except ArgumentError:
        return found
    return found | {
        f"{which} code{LEARNED}": CodeDescriptor(parts, which) for which in ("shape", "pose")
    }
