"""Registered bodies with labels, the common class of all data sets."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, SupportsIndex, TypeAlias, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from riemhuman.arrays import Array, Booleans, Integers, Labels, Values
from riemhuman.bodies import BodyModel
from riemhuman.checks import checked, distance_matrix, instance, real_array
from riemhuman.checks.labels import class_indices, plain_text, texts_or_numbers
from riemhuman.errors import ArgumentError, FileFormatError, shown
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
_REQUIRED = (
    "format_version",
    "template_vertices",
    "template_faces",
    "points",
    "subject",
    "pose",
    "subject_names",
    "pose_names",
    "ids",
)
_OPTIONAL = ("betas", "pose_vectors", "translations")


@checked(
    template=instance(Template),
    model=instance(BodyModel),
    subject_names=texts_or_numbers,
    pose_names=texts_or_numbers,
    ids=texts_or_numbers,
)
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
        shape = ("n_bodies", self.template.n_vertices, 3)
        points = real_array(self.points, "points", shape, batched=False)
        n = len(points)
        subject = _checked_labels(self.subject, "subject", n, self.subject_names)
        pose = _checked_labels(self.pose, "pose", n, self.pose_names)
        betas = _checked_rows(self.betas, "betas", n, "n_betas")
        pose_vectors = _checked_rows(self.pose_vectors, "pose_vectors", n, "n_joints", 3)
        translations = _checked_rows(self.translations, "translations", n, 3)
        ids = self.ids or tuple(map(str, range(n)))
        if len(ids) != n or len(set(ids)) < n:
            raise ArgumentError(
                f"ids must hold a different name for each of the {n} surfaces; found "
                f"{len(ids)} names, {len(set(ids))} of them different"
            )
        # What was checked takes the place of what was given; the class is frozen.
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "ids", ids)
        object.__setattr__(self, "subject", subject)
        object.__setattr__(self, "pose", pose)
        object.__setattr__(self, "betas", betas)
        object.__setattr__(self, "pose_vectors", pose_vectors)
        object.__setattr__(self, "translations", translations)

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
        numbers = np.arange(len(self))[index]
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
        arrays: dict[str, Values] = {
            "format_version": np.array(_FORMAT_VERSION),
            "template_vertices": self.template.vertices,
            "template_faces": self.template.faces,
            "points": self.points,
            "subject": self.subject,
            "pose": self.pose,
            # An empty list of names would be an array of numbers.
            "subject_names": np.array(self.subject_names, dtype=np.str_),
            "pose_names": np.array(self.pose_names, dtype=np.str_),
            "ids": np.array(self.ids, dtype=np.str_),
        }
        if self.betas is not None:
            arrays["betas"] = self.betas
        if self.pose_vectors is not None:
            arrays["pose_vectors"] = self.pose_vectors
        if self.translations is not None:
            arrays["translations"] = self.translations
        save_arrays(path, arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Bodies:
        """Read surfaces and labels that `save` has written, without a body model.

        Parameters
        ----------
        path : path_like
        """
        arrays = load_arrays(path, _REQUIRED, _OPTIONAL)
        version = arrays["format_version"].tolist()
        if version != _FORMAT_VERSION:
            raise FileFormatError(
                f"{path} is of format version {str(version)[:60]}; this release reads version "
                f"{_FORMAT_VERSION}"
            )
        with format_errors(file_path(path), "a file of bodies"):
            template = Template(arrays["template_vertices"], arrays["template_faces"])
            return cls(
                arrays["points"],
                arrays["subject"],
                arrays["pose"],
                template,
                subject_names=tuple(arrays["subject_names"].tolist()),
                pose_names=tuple(arrays["pose_names"].tolist()),
                betas=arrays.get("betas"),
                pose_vectors=arrays.get("pose_vectors"),
                translations=arrays.get("translations"),
                ids=tuple(arrays["ids"].tolist()),
            )

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
        return replace(
            self,
            points=self.points[numbers],
            subject=self.subject[numbers],
            pose=self.pose[numbers],
            betas=_rows_of(self.betas, numbers),
            pose_vectors=_rows_of(self.pose_vectors, numbers),
            translations=_rows_of(self.translations, numbers),
            ids=tuple(self.ids[number] for number in numbers),
        )


def _checked_labels(labels: Labels, name: str, n_bodies: int, names: Sequence[str]) -> Integers:
    """Return the class of each surface, an index into names."""
    numbers = class_indices(labels, name, n_bodies)
    if numbers.size and not 0 <= numbers.min() <= numbers.max() < len(names):
        raise ArgumentError(
            f"{name} holds labels from {numbers.min()} to {numbers.max()}; {name}_names has only "
            f"{len(names)} names"
        )
    return numbers


def _checked_rows(values: object | None, name: str, n_bodies: int, *row: int | str) -> Array | None:
    """Return parameters, a row for each surface, if there are some."""
    if values is None:
        return None
    return real_array(values, name, (n_bodies, *row), batched=False)


def _rows_of(values: Array | None, numbers: Integers) -> Array | None:
    return None if values is None else values[numbers]


def _labels(
    classes: str | int | Iterable[str | int], name: str, names: tuple[str, ...]
) -> list[int]:
    """Return the indices of people or poses given by name or index."""
    numbers: dict[object, int] = {plain_text(text): number for number, text in enumerate(names)}
    numbers |= {number: number for number in range(len(names))}
    try:
        several = [classes] if isinstance(classes, (str, int, np.integer)) else list(classes)
        return [numbers[plain_text(c) if isinstance(c, str) else c] for c in several]
    except (KeyError, TypeError) as error:
        raise ArgumentError(
            f"{name} must be names or indices of {', '.join(names[:20])}; found {shown(classes)}"
        ) from error
