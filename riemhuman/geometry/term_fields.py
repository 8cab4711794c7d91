"""The spaces of fields that terms measure in, each with its metric, and how surfaces map there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from numpy import ndarray

from riemhuman.errors import NotDefinedError
from riemhuman.geometry.manifold import Manifold
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.geometry.metric_fields import EbinMetric, MetricFields
from riemhuman.geometry.normal_fields import NormalFields
from riemhuman.geometry.product import ProductManifold, ProductMetric
from riemhuman.geometry.vector_space import FlatMetric, VectorSpace
from riemhuman.kernels import surface
from riemhuman.terms.ebin import EbinTerm
from riemhuman.terms.flat import FlatTerm
from riemhuman.terms.normals import NormalTerm
from riemhuman.terms.term import Term

if TYPE_CHECKING:
    from riemhuman.surfaces.template import Template


class FieldsNotDefinedError(NotDefinedError, AttributeError):
    """No manifold is known for the fields of a term: the metric has no `target_metric`."""


class TermFields:
    """The fields of one or several terms, as points of a manifold.

    Parameters
    ----------
    terms : sequence of Term
        The terms.
    template : Template
        The template T.

    Attributes
    ----------
    metric : RiemannianMetric
        The weighted sum of the terms' metrics, on the manifold of the fields.

    Raises
    ------
    FieldsNotDefinedError
        If no manifold is known for the fields of a term.
    """

    def __init__(self, terms: Sequence[Term], template: Template) -> None:
        self._terms = tuple(terms)
        factors = [_space_of(term, template) for term in self._terms]
        self.metric: RiemannianMetric = factors[0].metric
        self._product: ProductManifold | None = None
        weighted = len(factors) > 1 or self._terms[0].weight != 1.0
        if weighted or not isinstance(self._terms[0], FlatTerm):
            self._product = ProductManifold(factors)
            weights = [term.weight for term in self._terms]
            self.metric = self._product.equip_with_metric(ProductMetric, weights=weights).metric

    def of(self, first: surface.Derivatives) -> ndarray:
        r"""Return the fields of surfaces.

        Parameters
        ----------
        first : Derivatives
            First derivatives of surfaces.

        Returns
        -------
        array, shape (..., \*shape)
        """
        return self._join(
            [
                surface.first_fundamental_form(first.f_u, first.f_v)
                if isinstance(term, EbinTerm)
                else term.fields(first)[0]
                for term in self._terms
            ]
        )

    def changes(self, first: surface.Derivatives, h_u: ndarray, h_v: ndarray) -> ndarray:
        r"""Return the derivatives of the fields along deformations.

        Parameters
        ----------
        first : Derivatives
            First derivatives of surfaces.
        h_u, h_v : array, shape (..., F, 3)
            Partial derivatives of deformations.

        Returns
        -------
        array, shape (..., \*shape)
        """
        derivatives = first.f_u, first.f_v, h_u, h_v
        changes: list[Any] = []
        for term in self._terms:
            if isinstance(term, EbinTerm):
                changes.append(surface.first_fundamental_form_differential(*derivatives))
            elif isinstance(term, NormalTerm):
                changes.append(surface.unit_normals_differential(*derivatives))
            else:
                changes.append(term.changes(first, h_u, h_v)[0])
        return self._join(changes)

    def _join(self, fields: list[ndarray]) -> ndarray:
        return fields[0] if self._product is None else self._product.embed_to_product(fields)


def _space_of(term: Term, template: Template) -> Manifold:
    if isinstance(term, EbinTerm):
        return MetricFields(template).equip_with_metric(EbinMetric, lam=term.lam)
    if isinstance(term, NormalTerm):
        return NormalFields(template)
    if isinstance(term, FlatTerm):
        space = VectorSpace((template.n_faces, term.feature_shape(1)[0]))
        return space.equip_with_metric(FlatMetric, weights=template.face_areas)
    raise FieldsNotDefinedError(
        f"the fields of {type(term).__name__} have no manifold with exp and log; statistics of "
        'fields need an elastic metric, normals or flat terms; use image="points" otherwise'
    )
