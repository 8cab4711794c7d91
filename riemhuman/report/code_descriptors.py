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

LEARNED = ", trained here"  # ending of the names of learned codes in tables


@dataclass(frozen=True, eq=False)
class CodeDescriptor(Descriptor):
    """One of the two codes that a network computes for a body, with Euclidean distances.

    Shape and pose codes need surfaces in correspondence with the template of the network.

    Parameters
    ----------
    codes : ShapePoseCodes or IntrinsicExtrinsicCodes
        A trained network.
    which : {"shape", "pose", "intrinsic", "extrinsic"}
        Name of the code.

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
        if isinstance(self.codes, IntrinsicExtrinsicCodes):
            return self._half(self.codes.describe(vertices, faces)[None])[0]
        template = self.codes.template_
        template.check_faces(faces)
        return self._half(self.codes.transform(np.asarray(vertices)[None]))[0]

    def describe_all(self, bodies: Any, n_jobs: int | None = None) -> np.ndarray:
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
