from collections.abc import Callable

from numpy import float64
from numpy.typing import NDArray

def unbroadcast_f(
    target: NDArray[float64], f: Callable[[NDArray[float64]], NDArray[float64]]
) -> Callable[[NDArray[float64]], NDArray[float64]]: ...
