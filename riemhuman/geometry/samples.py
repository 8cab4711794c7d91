"""Number, spread and shape of random samples."""

from __future__ import annotations

from numpy import ndarray

from riemhuman.checks import real_number, whole_number


def sample_count(n_samples: int) -> int:
    """Return the number of samples asked for, at least one.

    Parameters
    ----------
    n_samples : int
        Number of samples.

    Returns
    -------
    int

    Raises
    ------
    ArgumentTypeError
        If the number is not an integer.
    ArgumentError
        If it is below 1.
    """
    return whole_number(n_samples, "n_samples", minimum=1)


def sample_bound(bound: float) -> float:
    """Return the spread of random points, at least 0.

    Parameters
    ----------
    bound : float
        Bound.

    Returns
    -------
    float

    Raises
    ------
    ArgumentTypeError
        If the bound is not a number.
    ArgumentError
        If it is below 0.
    """
    return real_number(bound, "bound", minimum=0.0)


def stack_samples(samples: ndarray, n_samples: int) -> ndarray:
    """Drop the first axis when one sample was asked for.

    Parameters
    ----------
    samples : array, shape (n_samples, ...)
        Samples.
    n_samples : int
        Number of samples.

    Returns
    -------
    array, shape (n_samples, ...), or (...) for one sample
    """
    return samples[0] if n_samples == 1 else samples
