r"""The base class of terms of metrics on surfaces: fields of first derivatives, with a metric.

A metric of surfaces over a template T is a sum of terms

.. math:: d(f_1, f_2)^2 = \sum_k w_k \int_T d_k(\varphi_k(f_1), \varphi_k(f_2))^2\, dx ,

each the pull-back, by fields φ_k(f) that depend on first derivatives triangle by triangle, of a
metric on the values of those fields.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property, partial
from typing import Protocol

import autograd.numpy as np
from autograd import value_and_grad

from riemhuman.arrays import Array, FeatureRows, Fields
from riemhuman.checks import checked, positive
from riemhuman.errors import NotDefinedError
from riemhuman.kernels.surface import Derivatives, differential, follow_up
from riemhuman.representation import constructor_text
from riemhuman.surfaces.template import Template

LENGTH = 12
"""Numbers in a record: three of f_u, three of f_v, three of n, then A, e and m."""


class FieldSpaces(Protocol):
    """The spaces of fields that the library provides, from which `Term.target_space` may choose.

    Examples
    --------
    >>> class Scaled(rh.terms.NormalTerm):
    ...     def target_space(self, spaces):
    ...         return spaces.normal_fields()
    """

    @property
    def template(self) -> Template:
        """The template on which the fields are defined."""

    def metric_fields(self, lam: float) -> object:
        """Return the space of first fundamental forms, with the Ebin metric.

        Its points have shape (F, 2, 2), like those of `riemhuman.MetricFields`.

        Parameters
        ----------
        lam : float above 0
            λ, the weight of changes of area.
        """

    def normal_fields(self) -> object:
        """Return the space of unit normals, with the metric of a product of spheres.

        Its points have shape (F, 3), like those of `riemhuman.NormalFields`.
        """

    def metric_and_normal_fields(self, a: float, b: float, c: float) -> object:
        """Return the product of both, with the metric that `GeneralElasticMetric` pulls back.

        Its points hold all first fundamental forms, then all normals, shape (7F,).

        Parameters
        ----------
        a, b, c : float
            Weights of stretching, of the change of area and of bending.
        """

    def vector_fields(self, n_features: int) -> object:
        """Return the space of n numbers per triangle with the L² metric; points have shape (F, n).

        Parameters
        ----------
        n_features : int
        """


class Term(ABC):
    """One term of a metric on surfaces.

    A subclass defines `fields`, `squared_dist` and `inner_product` with `autograd.numpy`, triangle
    by triangle. Distances, energies and their gradients, matrices and distances of many pairs are
    derived from these. The other methods are compiled forms of these three; overriding one makes a
    term faster.

    If the fields of a term are points of a manifold with exp and log, the term may declare it with
    `has_target_space`, `target_space` and `target_point`, as in the second example. Means,
    principal components and geodesics of fields then work for metrics that contain the term.

    Parameters
    ----------
    weight : float above 0

    Attributes
    ----------
    is_rotation_invariant : bool
        Whether rotating one of two surfaces leaves the term unchanged. Translating always does.
    is_stretch_invariant : bool
        Whether the term is unchanged when edges get longer or shorter.
    needs_area : bool
        Whether the fields exist only on triangles that have an area.
    single : bool
        Whether features may be kept in single precision.
    area_power : float
        Power of the area ratio A by which `form` is multiplied.
    has_target_space : bool
        Whether `target_space` and `target_point` are defined.

    Examples
    --------
    >>> import autograd.numpy as np
    >>> class LogArea(rh.terms.Term):
    ...     needs_area = True
    ...
    ...     def fields(self, first):
    ...         return (np.log(first.areas),)
    ...
    ...     def squared_dist(self, fields_a, fields_b):
    ...         return (fields_a[0] - fields_b[0]) ** 2
    ...
    ...     def inner_product(self, changes_a, changes_b, fields):
    ...         return changes_a[0] * changes_b[0]
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> metric = rh.SurfaceMetric(rh.AlignedSurfaces(bodies.template), [LogArea()])
    >>> metric.dist_pairwise(bodies.points[:3]).shape
    (3, 3)

    The logarithms of all areas are the points of a vector space:

    >>> class LogAreaWithSpace(LogArea):
    ...     has_target_space = True
    ...
    ...     def target_space(self, spaces):
    ...         return spaces.vector_fields(1)
    ...
    ...     def target_point(self, first):
    ...         return np.log(first.areas)[..., None]
    >>> metric = rh.SurfaceMetric(rh.AlignedSurfaces(bodies.template), [LogAreaWithSpace()])
    >>> change = metric.target_metric.log(metric.map(bodies[1]), metric.map(bodies[0]))
    >>> bool(np.isclose(metric.target_metric.norm(change), metric.dist(bodies[0], bodies[1])))
    True
    """

    weight = 1.0  # of subclasses that do not call __init__
    is_rotation_invariant = False
    is_stretch_invariant = False
    needs_area = False
    single = False
    area_power = 0.0
    has_target_space: bool = False

    @checked(weight=positive)
    def __init__(self, weight: float = 1.0) -> None:
        self.weight = weight

    def __repr__(self) -> str:
        return constructor_text(self)

    @abstractmethod
    def fields(self, first: Derivatives) -> Fields:
        """Return the fields of surfaces, arrays of shape (..., F) or (..., F, n).

        Parameters
        ----------
        first : Derivatives
            First derivatives of surfaces, arrays of shape (..., F) and (..., F, 3).
        """

    @abstractmethod
    def squared_dist(self, fields_a: Fields, fields_b: Fields) -> Array:
        """Return the squared distances on every triangle, without the weight, shape (..., F).

        Parameters
        ----------
        fields_a, fields_b : tuple of array
        """

    @abstractmethod
    def inner_product(self, changes_a: Fields, changes_b: Fields, fields: Fields) -> Array:
        """Return the inner products of changes of the fields, triangle by triangle, shape (..., F).

        Parameters
        ----------
        changes_a, changes_b : tuple of array
            Derivatives of the fields along deformations.
        fields : tuple of array
        """

    def changes(self, first: Derivatives, h_u: Array, h_v: Array) -> Fields:
        """Return the derivatives of the fields along deformations.

        Parameters
        ----------
        first : Derivatives
        h_u, h_v : array, shape (..., F, 3)
        """
        shape = np.broadcast_shapes(np.shape(first.f_u), np.shape(h_u))
        f_uv = np.stack([first.f_u + np.zeros(shape), first.f_v + np.zeros(shape)])
        h_uv = np.stack([h_u + np.zeros(shape), h_v + np.zeros(shape)])

        def field(k: int, derivatives: Array) -> Array:
            return self.fields(follow_up(derivatives[0], derivatives[1]))[k]

        count = len(self.fields(first))
        return tuple(differential(partial(field, k), h_uv, f_uv) for k in range(count))

    def form(self, first: Derivatives) -> Array:
        """Return the metric as quadratic forms of `surface.frame_components` of deformations.

        Their shape is (..., F, 6, 6). A term that treats all directions alike has one constant
        form, shape (6, 6), times A to `area_power`.

        Parameters
        ----------
        first : Derivatives
            First derivatives of surfaces whose triangles have an area.
        """
        p = np.sqrt(first.e)[..., None]
        q, r = first.m[..., None] / p, first.areas[..., None] / p
        e1 = first.f_u / p
        e2 = (first.f_v - q * e1) / r
        axes = (e1, e2, first.area_vectors / first.areas[..., None])
        fields = self.fields(first)
        # Along e_j ⊗ dx₁ and e_j ⊗ dx₂: h_u = p ∂₁h, h_v = q ∂₁h + r ∂₂h.
        changes = []
        for axis in axes:
            changes.append(self.changes(first, p * axis, q * axis))
            changes.append(self.changes(first, 0.0 * axis, r * axis))
        rows = [
            np.stack([self.inner_product(row, column, fields) for column in changes], axis=-1)
            for row in changes
        ]
        return np.stack(rows, axis=-2)

    def target_space(self, spaces: FieldSpaces) -> object:
        """Return the manifold on which the fields lie, equipped with the metric of the term.

        The metric is that of the term, integrated over the template, without the weight. You may
        return any `riemhuman.Manifold`: one of `spaces`, or your own, over `spaces.template`.

        Parameters
        ----------
        spaces : FieldSpaces
        """
        raise NotDefinedError(
            f"the fields of {type(self).__name__} have no manifold with exp and log, which "
            "statistics of fields need: the term defines no target_space; without one, use "
            'image="points"'
        )

    def target_point(self, first: Derivatives) -> Array:
        r"""Return the fields of surfaces as points of `target_space`, shape (..., \*shape).

        Parameters
        ----------
        first : Derivatives
            First derivatives of surfaces, arrays of shape (..., F) and (..., F, 3).
        """
        raise NotDefinedError(f"{type(self).__name__} defines no target_point")

    def chart(self, fields: Fields) -> Array | None:
        """Return coordinates whose Euclidean distances are at most those of the fields.

        Nearest-neighbour searches use them to avoid computing all distances. They have shape (...,
        F, n). By default there are none.

        Parameters
        ----------
        fields : tuple of array
        """
        return None

    def add_segments(self, records: Array, slopes: Array, areas: Array) -> float:
        """Return the sum of w d² over the segments of a path, and add its slopes.

        The sum is infinite where the fields do not exist.

        Parameters
        ----------
        records : array, shape (n_times, 12, n)
            Records of n triangles at all times: three numbers of f_u, three of f_v and three of
            the unit normal n, then the area ratio A, f_u·f_u and f_u·f_v. On a triangle without
            area, n and A are 0.
        slopes : array, shape (n_times, 12, n)
            Derivatives with respect to the numbers in the records, each taken for independent; they
            are added in place.
        areas : array, shape (n,)
        """
        if self.needs_area and not records[:, 9].all():
            return np.inf

        def energy(f_uv: Array) -> Array:
            fields = self.fields(follow_up(f_uv[..., :3], f_uv[..., 3:]))
            before = tuple(field[:-1] for field in fields)
            after = tuple(field[1:] for field in fields)
            return self.weight * np.sum(areas * self.squared_dist(before, after))

        value, gradient = value_and_grad(energy)(np.swapaxes(records[:, :6], 1, 2))
        slopes[:, :6] += np.swapaxes(gradient, 1, 2)
        return value

    @cached_property
    def n_features(self) -> int:
        """Number of features of each triangle."""
        return sum(int(np.prod(shape)) for shape in self._field_shapes())

    def pack(self, fields: Fields, areas: Array, kept: FeatureRows) -> float:
        """Write features; return a bound on the square of their rounding error.

        By default the bound is infinite, so distances from single precision are recomputed.

        Parameters
        ----------
        fields : tuple of array, each of shape (F,) or (F, n)
        areas : array, shape (F,)
        kept : array of float32 or float64, shape (n_features, F⁺)
            Features, with F⁺ ≥ F triangles in a row.
        """
        rows = [field.reshape(len(field), -1).T for field in fields]
        kept[:, : len(areas)] = np.concatenate(rows)
        return np.inf

    def pack_record(self, record: Array, areas: Array, kept: FeatureRows) -> float:
        """Write the features of one surface, see `pack`.

        Parameters
        ----------
        record : array, shape (12, F)
            Records of its triangles, see `add_segments`.
        areas : array, shape (F,)
        kept : array of float32 or float64, shape (n_features, F⁺)
        """
        return self.pack(self.fields(follow_up(record[:3].T, record[3:6].T)), areas, kept)

    def squared_distances(self, a: FeatureRows, b: FeatureRows, areas: Array) -> Array:
        """Return the squared distances between surfaces, without the weight, shape (n_a, n_b).

        Parameters
        ----------
        a, b : array
            Features of n_a and of n_b surfaces. For distances within one set, pass the same array
            twice; only the entries above the diagonal are used.
        areas : array, shape (F,)
        """
        fields_a, fields_b = self._unpack(a, len(areas)), self._unpack(b, len(areas))
        squared = np.empty((len(a), len(b)))
        for i in range(len(a)):
            row = tuple(field[i] for field in fields_a)
            squared[i] = self.squared_dist(row, fields_b) @ areas
        return squared

    def _field_shapes(self) -> list[tuple[int, ...]]:
        """Return the shapes of the values of the fields, from those of one triangle."""
        fields = self.fields(follow_up(np.eye(1, 3), np.eye(1, 3, 1)))
        return [np.shape(field)[1:] for field in fields]

    def _unpack(self, features: FeatureRows, n_faces: int) -> Fields:
        fields, start = [], 0
        for shape in self._field_shapes():
            end = start + int(np.prod(shape))
            rows = np.swapaxes(features[:, start:end, :n_faces], 1, 2)
            fields.append(rows.reshape(len(features), n_faces, *shape))
            start = end
        return tuple(fields)
