r"""Motions and changes of shape of one body replayed on another.

A triangle of body A and its normal move from frame P₀ to frame P; the matrix S = P P₀⁻¹ of this
change is applied to the same triangle of body B, and the surface whose derivatives come closest to
the results solves a Poisson equation (Sumner and Popović, "Deformation transfer for triangle
meshes", SIGGRAPH 2004; `riemhuman.surfaces.poisson`). B thus keeps its own metric field, changed by
as much as A's, and its triangles turn as those of A.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import one_of
from riemhuman.errors import ArgumentError
from riemhuman.kernels.special_orthogonal import nearest_rotations
from riemhuman.kernels.triangle_frames import (
    deformation_gradients,
    stacked_derivatives,
    triangle_frames,
)
from riemhuman.solvers.smooth_turn import SmoothTurn

if TYPE_CHECKING:
    from riemhuman.geometry.aligned_surfaces import AlignedSurfaces

AXES = ("world", "body")
TRANSFERS = ("change", "pose")

# Vertices that have moved by less, in metres, are still, as planted feet are.
_STILL = 0.01


@dataclass(frozen=True)
class MotionTransfer:
    """A motion of one body replayed on another.

    Parameters
    ----------
    axes : str
        "world": triangles of both bodies turn about the same axes in space, right where the target
        stands as the source does; "body": axes are carried from the source's triangles to the
        target's by the rotation between them, for a target in another pose.
    transfer : str
        "change": the target repeats the changes of the source since the reference; if its initial
        pose differs a little, its later poses differ as much, so that hands may end beside the head
        instead of on it. "pose": the target takes the pose of the source in every frame, whatever
        its own initial pose.

    Raises
    ------
    ArgumentError
        If an option is unknown, or poses are to be transferred about the axes of the body.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> motion = rh.datasets.load_open_motions("coarse", sequences="knees")[0][:30:10]
    >>> moved = rh.solvers.MotionTransfer().solve(space, motion, bodies[0])
    >>> moved.shape
    (3, 1202, 3)
    """

    axes: str = "world"
    transfer: str = "change"

    def __post_init__(self) -> None:
        one_of(self.axes, "axes", AXES)
        if one_of(self.transfer, "transfer", TRANSFERS) == "pose" and self.axes == "body":
            raise ArgumentError(
                'axes must be "world" where transfer="pose"; found "body", which is about the axes '
                "of changes"
            )

    def solve(
        self,
        space: AlignedSurfaces,
        motion: Any,
        target: ndarray,
        reference: ndarray | None = None,
    ) -> ndarray:
        """Return the target's motion.

        Parameters
        ----------
        space : AlignedSurfaces
            Space of the surfaces.
        motion : array, shape (n_frames, V, 3), or iterable of arrays (V, 3)
            Motion of the source.
        target : array, shape (V, 3)
            Body to be moved.
        reference : array, shape (V, 3), optional
            The source in the target's pose, by default the first frame: for a frame equal to the
            reference, the result is the target. Not used for poses.

        Returns
        -------
        array, shape (n_frames, V, 3)
            It is placed so that parts which rest on the source also rest on the target, above all
            planted feet: mean displacements of vertices agree, with weights 1/(d² + 1 cm²) of the
            displacement d. For poses, the first frame has the centroid of the source.

        Raises
        ------
        ArgumentError
            If the motion is empty, a surface does not fit the space, or there is a reference where
            poses are transferred.
        DegenerateSurfaceError
            If a triangle has no area.
        """
        if reference is not None and self.transfer == "pose":
            raise ArgumentError(
                'reference must be left out where transfer="pose": poses are transferred as they '
                "are, whatever the pose of the target"
            )
        transfer: _Transfer | _PoseTransfer | None = None
        frames: list[ndarray] = []
        for k, frame in enumerate(motion):
            frame = _one_surface(space, frame, f"motion[{k}]")
            if transfer is None:
                target = _one_surface(space, target, "target")
                if self.transfer == "pose":
                    transfer = _PoseTransfer(space, frame, target)
                else:
                    start = _one_surface(
                        space, frame if reference is None else reference, "reference"
                    )
                    transfer = _Transfer(space, start, target, self.axes)
            frames.append(transfer.moved(frame))
        if not frames:
            raise ArgumentError("motion must have at least one frame; found none")
        return np.stack(frames)


@dataclass(frozen=True)
class ShapeTransfer:
    """A change of shape, transferred to another pose.

    The difference between two bodies in one pose is applied to the first body in another pose: its
    triangles undergo the same stretches, along axes that turn with them.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> result = rh.solvers.ShapeTransfer().solve(space, bodies[0], bodies[10], bodies[3])
    >>> result.shape
    (1202, 3)
    """

    def solve(
        self, space: AlignedSurfaces, before: ndarray, after: ndarray, target: ndarray
    ) -> ndarray:
        """Return the second body in the target's pose.

        Parameters
        ----------
        space : AlignedSurfaces
            Space of the surfaces.
        before, after : array, shape (V, 3)
            The first and the second body in one pose.
        target : array, shape (V, 3)
            The first body in another pose.

        Returns
        -------
        array, shape (V, 3)
            The centroid of each connected component is that of the target.

        Raises
        ------
        ArgumentError
            If a surface does not fit the space.
        DegenerateSurfaceError
            If a triangle has no area.
        """
        before, after, target = (
            _one_surface(space, body, name)
            for body, name in ((before, "before"), (after, "after"), (target, "target"))
        )
        transfer = _Transfer(space, before, target, "body")
        return transfer.moved(after, placed_as=target)


class _Transfer:
    """What takes deformations of a reference to a target."""

    def __init__(
        self, space: AlignedSurfaces, reference: ndarray, target: ndarray, axes: str
    ) -> None:
        self._operator = space.template.differential_operator
        self._interpolator = space.template.interpolator
        self._areas = space.template.vertex_areas
        self._reference, self._target = reference, target
        self._frames = triangle_frames(reference, self._operator)
        self._target_frames = triangle_frames(target, self._operator)
        self._axes = None
        if axes == "body":
            gradients = deformation_gradients(self._frames, self._target_frames)
            self._axes = nearest_rotations(gradients)

    def moved(self, surface: ndarray, placed_as: ndarray | None = None) -> ndarray:
        """Return the target, deformed as the reference is deformed into this surface."""
        frames = triangle_frames(surface, self._operator)
        gradients = deformation_gradients(self._frames, frames)
        if self._axes is not None:
            gradients = self._axes @ gradients @ np.swapaxes(self._axes, -1, -2)
        derivatives = stacked_derivatives(gradients @ self._target_frames)
        if placed_as is not None:
            return self._interpolator.surface_of(derivatives, placed_as)
        displacement = surface - self._reference
        moved = self._interpolator.surface_of(derivatives, self._target + displacement)
        return _placed(moved, self._target, displacement, self._areas)


class _PoseTransfer:
    """What makes a target stand as a source does."""

    def __init__(self, space: AlignedSurfaces, first: ndarray, target: ndarray) -> None:
        self._turn = SmoothTurn(space)
        self._areas = space.template.vertex_areas
        self._first, self._target = first, target
        self._start = self._turn.solve(target, first)

    def moved(self, surface: ndarray) -> ndarray:
        """Return the target in the pose of a surface."""
        moved = self._turn.solve(self._target, surface)
        return _placed(moved, self._start, surface - self._first, self._areas)


def _placed(moved: ndarray, start: ndarray, displacement: ndarray, areas: ndarray) -> ndarray:
    """Return a surface shifted so that it has left its start as far as what is still has."""
    weights = areas / (_STILL**2 + np.sum(displacement**2, axis=1))
    return moved + np.average(start + displacement - moved, axis=0, weights=weights)


def _one_surface(space: AlignedSurfaces, surface: Any, name: str) -> ndarray:
    surface = np.asarray(space.check_immersed(surface, name))
    if surface.ndim != len(space.shape):
        raise ArgumentError(
            f"{name} must be one surface of shape {space.shape}; found {surface.shape}"
        )
    space.check_scale(surface, name)
    return surface
