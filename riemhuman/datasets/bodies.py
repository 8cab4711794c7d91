"""Registered bodies with labels, the common class of all data sets."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, SupportsIndex, TypeAlias, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riemhuman.arrays import Array, Booleans, Integers, JSONRecord
from riemhuman.bodies import BodyModel
from riemhuman.checks import (
    check_instance,
    class_indices,
    distance_matrix,
    real_array,
    texts_or_numbers,
)
from riemhuman.errors import ArgumentError, FileFormatError, FrameIndexError, shown
from riemhuman.io.arrays import load_arrays, save_arrays
from riemhuman.io.files import file_path, format_errors
from riemhuman.optional import import_optional
from riemhuman.provided import notebook_pictures
from riemhuman.surfaces.template import Template

if TYPE_CHECKING:
    import pandas

Class = int | str
Rows: TypeAlias = "slice[int | None, int | None, int | None]"

_FORMAT_VERSION = 1
_SEXES = ("woman", "man")
_NAMES = ("subject_names", "pose_names", "ids")
_STORED = ("points", "subject", "pose", "betas", "pose_vectors", "translations")


@dataclass(frozen=True, eq=False, repr=False)
class Bodies:
    """Registered body surfaces, with the person and the pose of each surface.

    ``bodies[3]`` is surface 3, shape (V, 3); ``bodies[2:8]``, ``bodies[mask]`` and
    ``bodies[[0, 5]]`` are `Bodies` with the chosen surfaces, and `select` chooses by person and
    pose.

    Parameters
    ----------
    points : array_like, shape (n, V, 3)
        Surfaces in metres, y up, all with the template's triangles.
    subject : array_like of int, shape (n,)
        The person of each surface: an index into `subject_names`.
    pose : array_like of int, shape (n,)
        The pose of each surface: an index into `pose_names`.
    template : Template
        The template to which all surfaces are registered.
    model : BodyModel, optional
    subject_names, pose_names : tuple of str
    betas : array_like, shape (n, B), optional
    pose_vectors : array_like, shape (n, J, 3), optional
        Axis-angle joint rotations, radians.
    translations : array_like, shape (n, 3), optional
        In metres.
    ids : tuple of str
        Name of each surface, for example that of its file; by default its number, from 0.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> bodies
    <Bodies: 100 surfaces, 10 people in 10 poses, 1,202 vertices, 2,400 triangles, with their
    body model>
    >>> bodies.select(subject="lanky man")[:2].ids
    ('70', '71')
    """

    points: Array
    subject: Integers
    pose: Integers
    template: Template
    model: BodyModel | None = None
    subject_names: tuple[str, ...] = ()
    pose_names: tuple[str, ...] = ()
    betas: Array | None = None
    pose_vectors: Array | None = None
    translations: Array | None = None
    ids: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_instance(self.template, "template", Template)
        if self.model is not None:
            check_instance(self.model, "model", BodyModel)
        shape = ("n_bodies", self.template.n_vertices, 3)
        points = real_array(self.points, "points", shape, batched=False, lengths=True)
        values: dict[str, object] = {"points": points}
        for name in ("subject", "pose"):
            labels = class_indices(getattr(self, name), name, len(points))
            names = texts_or_numbers(getattr(self, f"{name}_names"), f"{name}_names")
            if labels.size and not 0 <= labels.min() <= labels.max() < len(names):
                raise ArgumentError(
                    f"{name} holds labels from {labels.min()} to {labels.max()}; {name}_names "
                    f"has only {len(names)} names"
                )
            values |= {name: labels, f"{name}_names": names}
        trailing = {"betas": ("n_betas",), "pose_vectors": ("n_joints", 3), "translations": (3,)}
        for name, row in trailing.items():
            value = getattr(self, name)
            if value is not None:
                values[name] = real_array(value, name, (len(points), *row), batched=False)
        ids = texts_or_numbers(self.ids, "ids") or tuple(map(str, range(len(points))))
        if len(ids) != len(points) or len(set(ids)) < len(ids):
            raise ArgumentError(
                f"ids must hold a different name for each of the {len(points)} surfaces; found "
                f"{len(ids)} names, {len(set(ids))} of them different"
            )
        # As the class is frozen; what was checked takes the place of what was given.
        vars(self).update(values, ids=ids)

    def __len__(self) -> int:
        """Return the number of surfaces."""
        return len(self.points)

    @overload
    def __getitem__(self, index: int) -> Array: ...
    @overload
    def __getitem__(self, index: Rows | Sequence[int] | Integers | Booleans) -> Bodies: ...
    def __getitem__(
        self,
        index: SupportsIndex | Rows | Sequence[int] | Integers | Booleans,
    ) -> Array | Bodies:
        try:
            numbers = np.arange(len(self))[index]
        except (IndexError, TypeError) as error:
            raise FrameIndexError(f"{self!r} has no surfaces {shown(index)}: {error}") from error
        if np.ndim(numbers) > 1:
            raise FrameIndexError(
                f"bodies are indexed by a number, a slice, a mask or a list of numbers; found "
                f"{index!r}"
            )
        return self.points[numbers] if np.ndim(numbers) == 0 else self._choose(numbers)

    def select(
        self,
        subject: Class | Sequence[Class] | None = None,
        pose: Class | Sequence[Class] | None = None,
    ) -> Bodies:
        """Return the surfaces of some people in some poses.

        Parameters
        ----------
        subject : int, str, or sequence of them, optional
            Indices into `subject_names`, or names; by default all people.
        pose : int, str, or sequence of them, optional
            Indices into `pose_names`, or names; by default all poses.
        """
        is_selected = np.ones(len(self), dtype=bool)
        if subject is not None:
            is_selected &= np.isin(self.subject, _labels(subject, "subject", self.subject_names))
        if pose is not None:
            is_selected &= np.isin(self.pose, _labels(pose, "pose", self.pose_names))
        return self._choose(np.flatnonzero(is_selected))

    @property
    def sex(self) -> NDArray[np.str_]:
        """The sex of each surface, shape (n,): "woman", "man" or "".

        It is taken from the last word of the person's name, as in the open bodies; for other names
        it is unknown.

        Examples
        --------
        >>> bodies = rh.datasets.load_open_bodies("coarse")
        >>> bodies[bodies.sex == "woman"]
        <Bodies: 50 surfaces, 5 people in 10 poses, 1,202 vertices, 2,400 triangles, with their
        body model>
        """
        last_words = [name.split()[-1:] for name in self.subject_names]
        sexes = [words[0] if words and words[0] in _SEXES else "" for words in last_words]
        by_body: NDArray[np.str_] = np.array(sexes, dtype=str)[self.subject]
        return by_body

    def to_frame(self, distances: ArrayLike | None = None) -> pandas.DataFrame:
        """Return the labels of the surfaces, or labelled distances, as a pandas table.

        Parameters
        ----------
        distances : array_like, shape (n, n), optional
            Distances between the surfaces, such as those of `dist_pairwise`. Rows and columns are
            then named after person and pose, or after `ids` if two surfaces would have the same
            name.

        Raises
        ------
        MissingDependencyError
            If pandas is not installed.

        Examples
        --------
        >>> bodies = rh.datasets.load_open_bodies("coarse")[:3]
        >>> metric = rh.ElasticMetric(rh.AlignedSurfaces(bodies.template, equip=False), 1, 1e-4, 0)
        >>> table = bodies.to_frame(metric.dist_pairwise(bodies.points))
        >>> round(table.loc["tall slim woman, t_like", "tall slim woman, arms_up"], 3)
        0.086
        """
        frames = import_optional("pandas", "tables")
        people = [self.subject_names[number] for number in self.subject]
        poses = [self.pose_names[number] for number in self.pose]
        if distances is None:
            columns = {"subject": people, "pose": poses, "sex": self.sex}
            return frames.DataFrame(columns, index=list(self.ids))
        matrix = distance_matrix(distances, "distances")
        if len(matrix) != len(self):
            raise ArgumentError(
                f"distances must be between the {len(self)} surfaces; found {len(matrix)} rows"
            )
        names = [f"{person}, {pose}" for person, pose in zip(people, poses, strict=True)]
        if len(set(names)) < len(names):
            names = list(self.ids)
        return frames.DataFrame(matrix, index=names, columns=names)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the surfaces and their labels, but not the body model, to an .npz file.

        Parameters
        ----------
        path : path_like
            The file, with its suffix; an existing file is replaced.
        """
        arrays = {
            "format_version": np.array(_FORMAT_VERSION),
            "template_vertices": self.template.vertices,
            "template_faces": self.template.faces,
        }
        for name in _STORED:
            if getattr(self, name) is not None:
                arrays[name] = np.asarray(getattr(self, name))
        # An empty list of names would be an array of numbers.
        arrays |= {name: np.array(getattr(self, name), dtype=np.str_) for name in _NAMES}
        save_arrays(path, arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Bodies:
        """Read surfaces and labels that `save` has written, without a body model.

        Parameters
        ----------
        path : path_like
        """
        required = ("format_version", "template_vertices", "template_faces", "points")
        arrays = load_arrays(path, required, (*_STORED, *_NAMES))
        version = arrays["format_version"].tolist()
        if version != _FORMAT_VERSION:
            raise FileFormatError(
                f"{path} is of format version {str(version)[:60]}; this release reads version "
                f"{_FORMAT_VERSION}"
            )
        with format_errors(file_path(path), "a file of bodies"):
            template = Template(arrays["template_vertices"], arrays["template_faces"])
            values: JSONRecord = {name: arrays[name] for name in _STORED if name in arrays}
            values |= {name: tuple(arrays[name].tolist()) for name in _NAMES if name in arrays}
            return cls(template=template, **values)

    def __repr__(self) -> str:
        people, poses = len(np.unique(self.subject)), len(np.unique(self.pose))
        return (
            f"<Bodies: {len(self)} surfaces, {people} people in {poses} poses, "
            f"{self.template.n_vertices:,} vertices, {self.template.n_faces:,} triangles"
            f"{'' if self.model is None else ', with their body model'}>"
        )

    def _repr_html_(self) -> str:
        caption = repr(self).strip("<>")
        return notebook_pictures().surfaces_html(self.points, self.template.faces, caption)

    def _choose(self, numbers: Integers) -> Bodies:
        arrays: JSONRecord = {
            name: getattr(self, name)[numbers]
            for name in _STORED
            if getattr(self, name) is not None
        }
        return replace(self, **arrays, ids=tuple(self.ids[number] for number in numbers))


def _labels(
    classes: str | int | Iterable[str | int], name: str, names: tuple[str, ...]
) -> list[int]:
    """Return the indices of people or poses given by name or index."""
    numbers: dict[object, int] = {text: number for number, text in enumerate(names)}
    numbers |= {number: number for number in range(len(names))}
    try:
        several = [classes] if isinstance(classes, (str, int, np.integer)) else list(classes)
        return [numbers[label] for label in several]
    except (KeyError, TypeError) as error:
        raise ArgumentError(
            f"{name} must be names or indices of {', '.join(names[:20])}; found {shown(classes)}"
        ) from error
