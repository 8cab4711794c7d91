"""Squared angles between unit vectors by a polynomial, without branches, in both precisions."""

from __future__ import annotations

import math

import numpy as np

from riemhuman.kernels.compiled import FUSED, compiled, polynomial

# θ²/p for p in [0, 2]; the largest relative errors are 1e-8 and 1e-16.
arc = polynomial(
    (1.0, 0.0833329484, 0.0111162076, 0.00176024658, 0.000380191312, -2.4703817e-05)
    + (7.68320388e-05, -2.45728515e-05, 5.56007217e-06),
    (1.0, 0.0833333333333205, 0.011111111111878005, 0.0017857142675714339)
    + (0.00031746054353039055, 6.012334749789467e-05, 1.190145497780534e-05)
    + (2.3980475012020936e-06, 5.842167643945109e-07, -3.5749647809176705e-08)
    + (2.2820448805102648e-07, -2.1628319740394816e-07, 1.8342623990398518e-07)
    + (-1.1331536542028546e-07, 5.278573124328368e-08, -1.7707505291974977e-08)
    + (4.091256168225173e-09, -5.823618089617082e-10, 3.9471653680487684e-11),
)


@compiled(forceinline=True, fastmath=FUSED)
def squared_arc_and_slope(chord: float, acute: bool) -> tuple[float, float]:
    """Return θ² and dθ²/dp = θ/sin θ of unit vectors n and m, where p = ‖n − m‖².

    Parameters
    ----------
    chord : float
        p, or 4 − p = ‖n + m‖² if that is less.
    acute : bool
        Whether it is p.

    Returns
    -------
    value, slope : float
        The slope is 0 at antipodal vectors, where it does not exist.
    """
    ratio = np.sqrt(arc(chord))
    shorter = np.sqrt(chord) * ratio
    # sin θ = ½ √(p (4 − p)).
    slope = 2.0 * ratio / np.sqrt(4.0 - chord)
    angle = math.pi - shorter
    sine = 0.5 * np.sqrt(chord * (4.0 - chord))
    obtuse = angle / sine if chord > 0.0 else 0.0
    return (shorter * shorter, slope) if acute else (angle * angle, obtuse)
