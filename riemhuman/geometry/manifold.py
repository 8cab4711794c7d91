"""The abstract manifold: a space that comes with a metric."""

from __future__ import annotations

from copy import copy
from typing import Any, Self

from riemhuman.errors import ArgumentTypeError
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.geometry.space import Space
from riemhuman.representation import constructor_text


class Manifold(Space):
    r"""A manifold whose points and tangent vectors are arrays of one shape.

    Subclasses say which arrays are points (`belongs`), project to the tangent spaces
    (`to_tangent`) and make examples (`random_point`).

    Parameters
    ----------
    equip : bool
        Whether to equip the manifold with its default metric.

    Attributes
    ----------
    dim : int
        Dimension.
    shape : tuple of int
        Shape of one point.
    metric : RiemannianMetric
        The metric the manifold was equipped with last.

    Examples
    --------
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> class Positive(rh.Manifold):
    ...     def __init__(self):
    ...         super().__init__(1, (1,))
    ...
    ...     def belongs(self, point, atol=1e-9):
    ...         return np.asarray(point)[..., 0] > 0
    ...
    ...     def to_tangent(self, vector, base_point=None):
    ...         return vector
    ...
    ...     def random_point(self, n_samples=1, bound=1.0, *, rng=None):
    ...         return np.exp(np.random.default_rng(rng).uniform(-bound, bound, (n_samples, 1)))
    >>> Positive().belongs(np.array([[2.0], [-1.0]])).tolist()
    [True, False]
    """

    metric: RiemannianMetric

    def __init__(self, dim: int, shape: tuple[int, ...], equip: bool = True) -> None:
        super().__init__(dim, shape)
        if equip and self.default_metric() is not None:
            self.equip_with_metric()

    def __repr__(self) -> str:
        return constructor_text(self, leave_out=("equip",))

    def default_metric(self) -> type[RiemannianMetric] | None:
        """Return the class of the metric the manifold comes with, if there is one."""
        return None

    def equip_with_metric(
        self, Metric: type[RiemannianMetric] | None = None, **metric_kwargs: Any
    ) -> Self:
        """Equip the manifold with a metric, `Metric(self, **metric_kwargs)`.

        Parameters
        ----------
        Metric : type, optional
            Subclass of `RiemannianMetric`; by default the manifold's own.
        **metric_kwargs
            Parameters of the metric.

        Returns
        -------
        Manifold
            The manifold itself.

        Raises
        ------
        ArgumentTypeError
            If `Metric` is no class, or not given where the manifold has no default metric.
        """
        Metric = self.default_metric() if Metric is None else Metric
        if Metric is None:
            raise ArgumentTypeError(
                f"Metric must be given: {type(self).__name__} has no default metric"
            )
        if not callable(Metric):
            raise ArgumentTypeError(
                "Metric must be a class of metrics, whose parameters follow by name as in "
                f"equip_with_metric(ElasticMetric, a=1.0); found {type(Metric).__name__}"
            )
        self.metric = Metric(self, **metric_kwargs)
        return self

    def new(self, equip: bool = True) -> Self:
        """Return a manifold with the same parameters, and its default metric or none.

        Parameters
        ----------
        equip : bool
            Whether to equip it with its default metric.

        Returns
        -------
        Manifold
        """
        other = copy(self)
        vars(other).pop("metric", None)
        if equip and other.default_metric() is not None:
            other.equip_with_metric()
        return other
