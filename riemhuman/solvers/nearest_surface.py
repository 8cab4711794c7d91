"""The surface whose fields Φ(f) = (g, n) are nearest to given fields."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import real_array, real_number, whole_number
from riemhuman.errors import DegenerateSurfaceError
from riemhuman.geometry import ElasticMetric, RiemannianMetric
from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.progress import ProgressBar
from riemhuman.solvers._dispersion import check_weights
from riemhuman.solvers._preconditioners import CholeskyFactor, SparseCholeskyFactor, metric_factor
from riemhuman.solvers.image_distances import image_distances
from riemhuman.solvers.results import MeanResult, Status, finish

# Steps after which the matrix is factored anew, and steps that are remembered.
_ROUND, _DAMPED_ROUND, _MEMORY = 30, 5, 20

# Steps that bring less, or more, than these shares of their promise raise, or lower, the damping.
_POOR, _GOOD = 0.25, 0.6
_LEAST_DAMPING = 1e-3

# Shares of a step that are tried before the matrix is factored anew, which costs many of them.
_LENGTHS = (1.0, 0.4, 0.15)

# A step that promises more than this share of the value is worth making, whatever the tolerance,
# unless it is below this share of the first value.
_LITTLE, _ROUNDING = 3e-3, 1e-8

# Share of the start's value below which a guess is one: where it is not, limbs may lie across.
_NEARBY = 0.25


@dataclass(frozen=True)
class NearestSurface:
    r"""The surface f that minimises Σ_i w_i d(Φ(f), y_i)²/Σ_i w_i over all its vertices.

    With one target y, a point of the image space that need not come from a surface, it is the
    projection of y to surfaces; with the images of several surfaces it is their Karcher mean, the
    functional of section 4 of the paper with no basis. The minimisation is a quasi-Newton method
    that starts from the metric's matrix at f, which is about half the Hessian.

    A metric of metric fields alone (c = 0) hardly sees how a surface bends, and a metric of normals
    alone (a = 0) does not see the size of triangles. A companion metric of small weight keeps the
    unseen part as it is at the start: ε d_companion(f, start)² is added to the functional.

    Parameters
    ----------
    companion : ElasticMetric, optional
        Companion. By default, an `ElasticMetric` whose weight a or c is 0 gets the part that it
        lacks, and other metrics none.
    companion_weight : float
        ε, of at least 0.
    tolerance : float
        Stop when the predicted decrease is at most this share of the first value of the functional.
    max_iter : int
        Largest number of steps tried.
    progress : bool
        Whether to show a progress bar over steps.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> metric = space.equip_with_metric(rh.ElasticMetric, a=1.0, lam=1.0, c=1.0)
    >>> companion = rh.ElasticMetric(space, a=1.0, lam=1.0, c=0.1)
    >>> nearest = rh.statistics.NearestSurface(companion)
    >>> components = rh.TangentPCA(space, n_components=1, nearest=nearest)
    """

    companion: ElasticMetric | None = None
    companion_weight: float = 1e-2
    tolerance: float = 1e-5
    max_iter: int = 200
    progress: bool = False

    def __post_init__(self) -> None:
        real_number(self.companion_weight, "companion_weight", minimum=0.0)
        real_number(self.tolerance, "tolerance", minimum=0.0, strict=True)
        whole_number(self.max_iter, "max_iter", minimum=1)

    def solve(
        self,
        metric: RiemannianMetric,
        images: ndarray,
        start: ndarray,
        weights: ndarray | None = None,
    ) -> MeanResult:
        r"""Find the surface.

        Parameters
        ----------
        metric : RiemannianMetric
            A metric on surfaces, pulled back by Φ = ``metric.map``.
        images : array, shape (n, \*target_shape)
            Targets y_i, points of the space of ``metric.target_metric``.
        start : array, shape (V, 3)
            Surface to start from.
        weights : array, shape (n,), optional
            Weights of at least 0; by default all are the same.

        Returns
        -------
        MeanResult
            `variance` is the weighted mean squared distance without the companion's part, which
            `variances` include.

        Raises
        ------
        ArgumentError
            If an array does not fit the metric.
        DegenerateSurfaceError
            If a triangle of `start` has no area.

        Warns
        -----
        ConvergenceWarning
            If the stopping test was not met.
        """
        target = metric.target_metric
        images = target.check_points(images, "images")
        weights = check_weights(weights, len(images))
        start = real_array(start, "start", metric.space.shape, batched=False)
        companion = self.companion
        if companion is None:
            companion = metric.complementary_metric
        if not self.companion_weight:
            companion = None

        distances = image_distances(metric, images, weights)

        def slope(f: ndarray) -> tuple[float, ndarray]:
            value, gradient = distances.value_and_gradient(f)
            if companion is None:
                return value, gradient
            squared, slopes = companion.energy_and_gradient(np.stack([start, f]))
            weight = self.companion_weight
            return value + weight * squared, gradient + weight * slopes[1]

        measured: Any = metric

        def factor(f: ndarray, damping: float) -> CholeskyFactor:
            # Damped where the metric sees little.
            if companion is None:
                return metric_factor(measured, f[np.newaxis], 1.0 / (1.0 + damping))
            unseen = (self.companion_weight + damping) * companion.metric_matrix(f)
            return SparseCholeskyFactor(measured.metric_matrix(f) + unseen)

        bar = ProgressBar(desc="surface", disable=not self.progress, unit=" steps")
        with single_threaded_libraries(), bar:
            least_damping = max(self.companion_weight, _LEAST_DAMPING)
            result = _descend(
                slope,
                factor,
                start,
                distances.nearby(start),
                self.tolerance,
                self.max_iter,
                least_damping,
                bar,
            )
        found = MeanResult(
            result.point,
            distances.value_and_gradient(result.point)[0],
            result.variances,
            **result.outcome,
        )
        finish(self, found)
        return found


def _descend(
    slope: Callable[[ndarray], tuple[float, ndarray]],
    factor: Callable[[ndarray, float], CholeskyFactor],
    f: ndarray,
    guess: ndarray,
    tolerance: float,
    max_iter: int,
    least_damping: float,
    bar: ProgressBar,
) -> MeanResult:
    """Return the minimiser near f.

    By L-BFGS, with factors of half the Hessian to start from; where steps bring less than they
    promise, the factor is damped, as by Levenberg and Marquardt, and renewed every few steps.
    """
    value, gradient = slope(f)
    if not np.isfinite(value):
        raise DegenerateSurfaceError("every triangle of start must have an area")
    values, n_evaluations = [value], 1
    guess_value, guess_gradient = slope(guess)
    if guess_value < _NEARBY * value:
        f, gradient = guess, guess_gradient
        values.append(guess_value)
        n_evaluations += 1
    converged, message = False, "the most steps were tried"
    memory: list[tuple[ndarray, ndarray]] = []
    damping, half_hessian, age, first = 0.0, factor(f, 0.0), 0, 0
    while n_evaluations <= max_iter:
        step = -_inverse_hessian_times(half_hessian, memory, gradient)
        promise = -0.5 * float(np.sum(gradient * step))
        little = max(_LITTLE * values[-1], _ROUNDING * values[0])
        if promise <= min(tolerance * values[0], little):
            converged, message = True, "a step promises less than the tolerance"
            break
        for length in _LENGTHS[first:]:
            n_evaluations += 1
            new_value, new_gradient = slope(f + length * step)
            share = (values[-1] - new_value) / (length * (2.0 - length) * promise)
            if share > _POOR:
                break
        # Where the last step was short, and did worse than it promised, the next begins short.
        first = 1 if length < 1.0 and share < _GOOD else 0
        if share > 0.0:
            memory = [*memory[1 - _MEMORY :], (length * step, new_gradient - gradient)]
            f, gradient = f + length * step, new_gradient
            values.append(new_value)
        bar.set_postfix_str(f"value {values[-1]:.6g}", refresh=False)
        bar.update()
        age += 1
        if share < _POOR:
            damping = max(4.0 * damping, least_damping)
        elif share > _GOOD:
            damping = 0.25 * damping if damping > _LEAST_DAMPING else 0.0
        if share < _POOR or age >= (_DAMPED_ROUND if damping > 0.0 else _ROUND):
            half_hessian, age, memory = factor(f, damping), 0, []
    return MeanResult(
        f,
        values[-1],
        np.array(values),
        n_iterations=len(values) - 1,
        n_evaluations=n_evaluations,
        status=Status.of(converged),
        message=message,
    )


def _inverse_hessian_times(
    half_hessian: CholeskyFactor, memory: list[tuple[ndarray, ndarray]], gradient: ndarray
) -> ndarray:
    """Return H g of the quasi-Newton method, by the recursion in two loops [1]_.

    .. [1] Nocedal and Wright, "Numerical Optimization", 2006, algorithm 7.4.
    """
    rest, shares = gradient, []
    curved = [(s, y, float(np.vdot(s, y))) for s, y in memory]
    curved = [pair for pair in curved if pair[2] > 0.0]
    for s, y, curvature in reversed(curved):
        shares.append(float(np.vdot(s, rest)) / curvature)
        rest = rest - shares[-1] * y
    found = 0.5 * half_hessian.inverse(rest.reshape(-1, 1)).reshape(gradient.shape)
    for (s, y, curvature), share in zip(curved, reversed(shares), strict=True):
        found = found + (share - float(np.vdot(y, found)) / curvature) * s
    return found
