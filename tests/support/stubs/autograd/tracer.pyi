from typing import TypeGuard, TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")

def getval(x: T) -> T: ...

# Arrays that are traced have the types of their values.
def isbox(x: object) -> TypeGuard[NDArray[np.float64]]: ...
