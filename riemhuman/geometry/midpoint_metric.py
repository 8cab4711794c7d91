"""Metrics on surfaces defined by their inner product alone, with compiled path energies."""

from __future__ import annotations

from numpy import ndarray

from riemhuman.geometry.metric_of_terms import MetricOfTerms
from riemhuman.kernels.drift import still_path
from riemhuman.terms.quadratic import SumOfQuadraticTerms


class MidpointMetric(MetricOfTerms):
    r"""A sum of terms given by their inner products, without a closed-form distance.

    The energy of a path is :math:`n \sum_i G_{(f_i + f_{i+1})/2}(f_{i+1} - f_i, f_{i+1} - f_i)`, of
    second order in the time step.

    Parameters
    ----------
    terms : sequence of QuadraticTerm
        The terms, see `riemhuman.terms.quadratic`.
    """

    driver = SumOfQuadraticTerms

    @property
    def is_translation_invariant(self) -> bool:
        """Whether translations cost nothing."""
        return all(term.is_translation_invariant for term in self.terms)

    @property
    def is_stretch_invariant(self) -> bool:
        """Whether changes of the lengths of edges cost nothing."""
        return all(term.is_stretch_invariant for term in self.terms)

    @property
    def is_reparametrization_invariant(self) -> bool:
        """Whether deformations tangential to a surface cost nothing."""
        return all(term.is_reparametrization_invariant for term in self.terms)

    def remove_drift(self, path: ndarray) -> ndarray:
        """Remove translations from a path if no term sees them.

        Returns
        -------
        array, shape (n_times, V, 3)
            A path of the same energy with the same ends.
        """
        path = self.check_points(path, "path")
        if not self.is_translation_invariant:
            return path
        return still_path(path, self.space.template.vertex_areas, rotations=False)
