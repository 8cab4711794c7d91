"""Algorithm 1 of the paper as printed: SciPy's L-BFGS-B in the coefficients of a basis."""

from types import SimpleNamespace

import numpy as np
from scipy import optimize

from riemhuman.solvers import SegmentEnergy


def paper_path(metric, basis, start, end, n_nodes=11, max_iter=300, energy=None, path=None):
    """Return path, energy, iterations, evaluations and the ratio gained from the straight path."""
    energy = energy or SegmentEnergy()
    line = np.linspace(start, end, n_nodes) if path is None else path
    shape = n_nodes - 2, len(basis)

    def path_of(coefficients):
        moved = line.copy()
        moved[1:-1] += basis.combine(coefficients.reshape(shape))
        return moved

    def objective(coefficients):
        value, gradient = energy.value_and_gradient(metric, path_of(coefficients))
        return value, (gradient[1:-1].reshape(n_nodes - 2, -1) @ basis.flat.T).ravel()

    begin = np.zeros(shape[0] * shape[1])
    options = {"ftol": 0.0, "gtol": 0.0, "maxiter": max_iter, "maxfun": 10 * max_iter}
    minimum = optimize.minimize(objective, begin, jac=True, method="L-BFGS-B", options=options)
    return SimpleNamespace(
        path=path_of(minimum.x),
        energy=float(minimum.fun),
        n_iterations=minimum.nit,
        n_evaluations=minimum.nfev,
        gain=float(minimum.fun) / objective(begin)[0],
    )
