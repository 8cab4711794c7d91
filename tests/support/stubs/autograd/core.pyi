from collections.abc import Callable

from numpy import float64
from numpy.typing import NDArray

def make_vjp(
    fun: Callable[..., object], x: NDArray[float64]
) -> tuple[Callable[[NDArray[float64]], NDArray[float64]], NDArray[float64]]: ...
