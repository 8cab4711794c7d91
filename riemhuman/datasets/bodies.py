"""The record every registered data set is loaded into."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from riemhuman.bodies import BodyModel
from riemhuman.checks import integer_array, real_array
from riemhuman.errors import ArgumentError
from riemhuman.surfaces.template import Template


@dataclass(frozen=True, eq=False)
class Bodies:
    """Registered body surfaces with the person and the pose of each.

    Parameters
    ----------
    points : array_like, shape (n, V, 3)
        Surfaces in metres, y up, all with the template's triangles.
    subject : array_like of int, shape (n,)
        Who is shown: an index into `subject_names`.
    pose : array_like of int, shape (n,)
        Which pose is held: an index into `pose_names`.
    template : Template
        The surface all are registered to.
    model : BodyModel, optional
        The body model the surfaces come from.
    subject_names, pose_names : tuple of str
        Readable names of the classes.
    betas : array_like, shape (n, B), optional
        Shape coefficients, where known.
    pose_vectors : array_like, shape (n, J, 3), optional
        Axis-angle joint rotations in radians, where known.
    translations : array_like, shape (n, 3), optional
        Translations in metres, where known.
    ids : tuple of str
        What each surface is called, for instance its file; by default its number, from 0.

    Raises
    ------
    ArgumentError
        If the lengths disagree, an index has no name, two surfaces are called alike, or an entry
        is not finite.
    """

    points: np.ndarray
    subject: np.ndarray
    pose: np.ndarray
    template: Template
    model: BodyModel | None = None
    subject_names: tuple[str, ...] = ()
    pose_names: tuple[str, ...] = ()
    betas: np.ndarray | None = None
    pose_vectors: np.ndarray | None = None
    translations: np.ndarray | None = None
    ids: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        points = real_array(
            self.points, "points", ("n_bodies", self.template.n_vertices, 3), batched=False
        )
        self._keep(points=points)
        for name in ("subject", "pose"):
            labels = integer_array(getattr(self, name), name, (len(points),))
            names = tuple(str(label) for label in getattr(self, f"{name}_names"))
            if labels.size and not 0 <= labels.min() <= labels.max() < len(names):
                raise ArgumentError(
                    f"{name} holds labels from {labels.min()} to {labels.max()}; "
                    f"{name}_names names only {len(names)} of them"
                )
            self._keep(**{name: labels, f"{name}_names": names})
        trailing = {
            "betas": ("n_betas",),
            "pose_vectors": ("n_joints", 3),
            "translations": (3,),
        }
        for name, shape in trailing.items():
            if getattr(self, name) is not None:
                array = real_array(getattr(self, name), name, (len(points), *shape), batched=False)
                self._keep(**{name: array})

        ids = tuple(str(name) for name in (self.ids or range(len(points))))
        if len(ids) != len(points) or len(set(ids)) < len(ids):
            raise ArgumentError(
                f"ids must be as many different names as there are surfaces, {len(points)}; found "
                f"{len(ids)}, {len(set(ids))} of them different"
            )
        self._keep(ids=ids)

    def __len__(self) -> int:
        """Return the number of surfaces."""
        return len(self.points)

    def _keep(self, **values: object) -> None:
        for name, value in values.items():
            object.__setattr__(self, name, value)
