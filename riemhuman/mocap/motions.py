"""Motions: sequences of surfaces that are computed or read on access."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Self, TypeVar

import numpy as np

from riemhuman.arrays import Array, ArrayLike, Integers, Triangles
from riemhuman.bodies import BodyModel
from riemhuman.checks import (
    checked,
    checked_rate,
    each,
    instance,
    numbers_at,
    real_array,
    whole,
)
from riemhuman.checks.labels import names_of, text_or_number
from riemhuman.errors import ArgumentError, ArgumentTypeError, FileError, NotDefinedError, shown
from riemhuman.io import save_glb
from riemhuman.io.files import file_path, suffix_of
from riemhuman.io.mesh_arrays import check_triangles
from riemhuman.io.meshes import save_mesh
from riemhuman.io.outputs import atomic_folder
from riemhuman.kernels.threads import Run, in_runs
from riemhuman.mocap._motion_files import (
    PosedPerson,
    write_amass,
    write_bvh,
    write_skinned_glb,
)
from riemhuman.surfaces.template import Template

M = TypeVar("M", bound="Motion")

# Frames per call of the model: enough to share its cost, few enough to need little memory.
_FRAMES_AT_A_TIME = 32

WRITTEN_MOTIONS = (".bvh", ".npz", ".glb")
"""Suffixes of the files that `save` of a motion of a body model writes."""


class Motion:
    """One person in one motion: a sequence of registered surfaces.

    ``motion[i]`` is frame i, shape (V, 3); ``motion[i:j:k]`` are frames, shape (n, V, 3), and
    ``motion[:]`` is the whole motion. Frames are computed or read on access, and not kept.

    Parameters
    ----------
    subject, sequence : str
        Names of the person and of the motion.
    frames_per_second : float
    n_frames : int
    faces : array of int, shape (F, 3)
        Triangles of every frame.

    Examples
    --------
    >>> motion = rh.datasets.load_open_motions("coarse", sequences="knees")[0]
    >>> motion[0].shape, motion[:10:5].shape
    ((1202, 3), (2, 1202, 3))
    """

    @checked(
        subject=text_or_number,
        sequence=text_or_number,
        frames_per_second=checked_rate,
        n_frames=whole(minimum=0),
    )
    def __init__(
        self,
        subject: str,
        sequence: str,
        frames_per_second: float,
        n_frames: int,
        faces: Triangles,
    ) -> None:
        self.subject = subject
        self.sequence = sequence
        self.frames_per_second = frames_per_second
        self.n_frames = n_frames
        checked = check_triangles(faces)
        # Motions of a model share its triangles.
        self.faces = faces if getattr(faces, "dtype", None) == checked.dtype else checked

    def __len__(self) -> int:
        return self.n_frames

    def __iter__(self) -> Iterator[Array]:
        for first in range(0, len(self), _FRAMES_AT_A_TIME):
            yield from self[first : first + _FRAMES_AT_A_TIME]

    def __getitem__(self, index: int | slice[int | None, int | None, int | None]) -> Array:
        numbers = numbers_at(index, len(self), self, "frame")
        if isinstance(numbers, range):
            return self._frames(numbers)
        frame: Array = self._frames(range(numbers, numbers + 1))[0]
        return frame

    def __repr__(self) -> str:
        return (
            f"<{type(self).__name__} {self.sequence!r} of {self.subject!r}, {len(self)} frames "
            f"at {self.frames_per_second:g} a second>"
        )

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the motion to a file, or to a folder of meshes.

        Parameters
        ----------
        path : path_like
            ``x.glb`` is an animation for Blender, game engines and viewers. A path without an
            ending is a folder of PLY files, one per frame, which must not exist yet. Motions of a
            body model are also written as ``x.bvh`` (skeleton, centimetres) and ``x.npz`` (AMASS's
            layout), and their GLB files hold a skeleton with a skin.

        Raises
        ------
        FileFormatError
            If the ending is another one.
        FileError
            If the file or folder cannot be written.

        Examples
        --------
        >>> motion = rh.datasets.load_open_motions("coarse", sequences="knees")[0]
        >>> motion.save("knees.glb")
        >>> motion.save("knees.bvh")
        """
        file = file_path(path)
        if not file.suffix:
            self._save_frames(file)
        else:
            self._save_file(file)

    def _save_file(self, file: Path) -> None:
        suffix_of(file, (".glb",))
        seconds = max(1, len(self) - 1) / self.frames_per_second
        save_glb(file, self[:], self.faces, seconds=seconds, name=self.sequence or "motion")

    def _save_frames(self, folder: Path) -> None:
        if folder.exists():
            raise FileError(f"{folder} exists; name a folder that does not exist yet")
        with atomic_folder(folder) as temporary:
            for number, frame in enumerate(self):
                save_mesh(temporary / f"frame_{number:05d}.ply", frame, self.faces)

    def _frames(self, numbers: range) -> Array:
        """Return these frames, shape (n, V, 3)."""
        raise NotDefinedError(
            f"{type(self).__name__} must define _frames, which returns frames of shape (n, V, 3)"
        )


class ModelMotion(Motion, ABC):
    """A motion whose frame i is ``model(betas, pose_vectors[i], translations[i])``."""

    @checked(model=instance(BodyModel))
    def __init__(
        self, subject: str, sequence: str, frames_per_second: float, n_frames: int, model: BodyModel
    ) -> None:
        super().__init__(subject, sequence, frames_per_second, n_frames, model.faces)
        self.model = model

    @property
    def template(self) -> Template:
        """The template of the model."""
        return self.model.template

    @property
    @abstractmethod
    def betas(self) -> Array:
        """Shape coefficients of the person, shape (B,)."""

    @property
    def pose_vectors(self) -> Array:
        """Axis-angle joint rotations in every frame, shape (n_frames, J, 3), radians."""
        return self._parameters(np.arange(len(self)))[0]

    @property
    def translations(self) -> Array:
        """Translation in every frame, shape (n_frames, 3), metres."""
        return self._parameters(np.arange(len(self)))[1]

    def _save_file(self, file: Path) -> None:
        ending = suffix_of(file, WRITTEN_MOTIONS)
        poses, translations = self._parameters(np.arange(len(self)))
        name, rate = self.sequence or file.stem, self.frames_per_second
        person = PosedPerson(self.model, self.betas, poses, translations, rate, name)
        if ending == ".bvh":
            write_bvh(file, person)
        elif ending == ".npz":
            write_amass(file, person)
        else:
            write_skinned_glb(file, person)

    def performed_by(self, betas: ArrayLike) -> ModelMotion:
        """Return the motion of another person, in the same poses and places.

        Parameters
        ----------
        betas : array_like, shape (B,)
        """
        new_betas = real_array(betas, "betas", (self.model.n_betas,), batched=False)
        poses, translations = self._parameters(np.arange(len(self)))
        names = (self.subject, self.sequence)
        return ArrayMotion(
            names, self.frames_per_second, self.model, new_betas, poses, translations
        )

    @abstractmethod
    def _parameters(self, numbers: Integers) -> tuple[Array, Array]:
        """Return the pose vectors and translations of some frames."""

    def _frames(self, numbers: range) -> Array:
        frames = np.empty((len(numbers), self.model.n_vertices, 3))
        poses, translations = self._parameters(np.asarray(numbers, dtype=np.int64))
        betas = self.betas

        def pose(some: Run) -> None:
            frames[some] = self.model(betas, poses[some], translations[some])

        in_runs(pose, len(numbers), _FRAMES_AT_A_TIME)
        return frames


class ArrayMotion(ModelMotion):
    """A motion of a model whose poses and translations are arrays.

    Parameters
    ----------
    names : (str, str)
        Names of the person and of the motion.
    frames_per_second : float
    model : BodyModel
    betas : array, shape (B,)
    pose_vectors : array, shape (n_frames, J, 3)
    translations : array, shape (n_frames, 3)

    Examples
    --------
    >>> model = rh.datasets.load_open_model("coarse")
    >>> poses, translations = np.zeros((10, model.n_joints, 3)), np.zeros((10, 3))
    >>> rh.datasets.ArrayMotion(
    ...     ("ann", "still"), 30.0, model, np.zeros(model.n_betas), poses, translations
    ... )
    <ArrayMotion 'still' of 'ann', 10 frames at 30 a second>
    """

    @checked(model=instance(BodyModel))
    def __init__(
        self,
        names: tuple[str, str],
        frames_per_second: float,
        model: BodyModel,
        betas: Array,
        pose_vectors: Array,
        translations: Array,
    ) -> None:
        subject, sequence = names_of(names, "names", 2, "names, of a person and a motion")
        self._betas = real_array(betas, "betas", (model.n_betas,), batched=False)
        shape = ("n_frames", model.n_joints, 3)
        self._poses = real_array(pose_vectors, "pose_vectors", shape, batched=False)
        n_frames = len(self._poses)
        self._translations = real_array(translations, "translations", (n_frames, 3), batched=False)
        super().__init__(subject, sequence, frames_per_second, n_frames, model)

    @property
    def betas(self) -> Array:
        return self._betas

    def _parameters(self, numbers: Integers) -> tuple[Array, Array]:
        return self._poses[numbers], self._translations[numbers]


_each_motion = each(instance(Motion), "a list of motions")


class Motions(tuple[M, ...]):
    """A tuple of motions with a one-line representation.

    Parameters
    ----------
    motions : iterable of Motion

    Examples
    --------
    >>> rh.datasets.load_open_motions("coarse", sequences=["knees", "hips"])
    <Motions: 20 of 10 people, 2 sequences>
    """

    def __new__(cls, motions: Iterable[M] = ()) -> Self:
        return super().__new__(cls, _each_motion(motions, "motions"))

    def __repr__(self) -> str:
        people = {motion.subject for motion in self}
        sequences = {motion.sequence for motion in self}
        return f"<Motions: {len(self)} of {len(people)} people, {len(sequences)} sequences>"


def choose_names(
    choice: str | int | Iterable[str | int] | None,
    name: str,
    all_names: Sequence[str],
    source: str = "",
) -> tuple[str, ...]:
    """Return the chosen names, by default all, after checking that they exist."""
    if choice is None:
        return tuple(all_names)
    try:
        several = [choice] if isinstance(choice, (str, int, np.integer)) else choice
        names = tuple(str(label) for label in several)
    except TypeError as error:
        raise ArgumentTypeError(f"{name} must be a list of names; found {shown(choice)}") from error
    unknown = [label for label in names if label not in all_names]
    if unknown or not names or len(set(names)) < len(names):
        problem = (
            "unknown: " + ", ".join(map(repr, unknown)) if unknown else f"found {shown(choice)}"
        )
        raise ArgumentError(
            f"{name} must be one or more different names among {', '.join(all_names)}{source}; "
            f"{problem}"
        )
    return names
