r"""The pulled-back metrics as quadratic forms of the corners of each triangle.

At a surface f, every triangle has an orthonormal frame e₁, e₂, n of its own. A deformation h has
derivatives ∂₁h, ∂₂h along it, and with ε_ij = ½(e_i·∂_j h + e_j·∂_i h)

.. math:: \operatorname{tr}((g^{-1}\delta g_0)^2) = 2(\varepsilon_{11} - \varepsilon_{22})^2
          + 8\varepsilon_{12}^2, \quad \operatorname{tr}(g^{-1}\delta g)
          = 2(\varepsilon_{11} + \varepsilon_{22}), \quad
          \|\delta n\|^2 = (n\cdot\partial_1 h)^2 + (n\cdot\partial_2 h)^2,

so the squared norm of h is a sum of squares of linear forms of its nine corner coordinates.
"""

from __future__ import annotations

import numpy as np
from numpy import ndarray


def elastic_blocks(
    points: ndarray,
    faces: ndarray,
    areas: ndarray,
    *,
    a: float = 0.0,
    lam: float = 0.0,
    c: float = 0.0,
    b: float = 0.0,
) -> ndarray:
    """Return the 9 × 9 matrices of the metric at a surface, one a triangle.

    Parameters
    ----------
    points : array, shape (V, 3)
        Surface f; every triangle has an area.
    faces : array of int, shape (F, 3)
        Triangles.
    areas : array, shape (F,)
        Template areas w_t.
    a, lam, c : float
        Weights of the elastic metric.
    b : float
        Weight of the square root normal field metric.

    Returns
    -------
    array, shape (F, 9, 9)
        Rows and columns run over the coordinates of the first, the second, the third corner.
    """
    corners = points[faces]
    side, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    base = np.linalg.norm(side, axis=1)
    e1 = side / base[:, None]
    reach = np.sum(other * e1, axis=1)
    across = other - reach[:, None] * e1
    height = np.linalg.norm(across, axis=1)
    e2 = across / height[:, None]
    n = np.cross(e1, e2)
    surface_areas = 0.5 * base * height

    # Gradients of the three barycentric coordinates along e₁ and e₂.
    along1 = np.stack([-1.0 / base, 1.0 / base, np.zeros_like(base)], axis=1)
    along2 = np.stack([(reach - base) / (base * height), -reach / (base * height), 1 / height], 1)

    def form(direction: ndarray, gradient: ndarray) -> ndarray:
        return (gradient[:, :, None] * direction[:, None, :]).reshape(-1, 9)

    strain11, strain22 = form(e1, along1), form(e2, along2)
    strain12 = 0.5 * (form(e1, along2) + form(e2, along1))
    rows = []
    if a > 0:
        root = np.sqrt(a * surface_areas)[:, None]
        rows += [
            np.sqrt(2.0) * root * (strain11 - strain22),
            np.sqrt(8.0) * root * strain12,
            2.0 * np.sqrt(lam) * root * (strain11 + strain22),
        ]
    if c > 0:
        root = np.sqrt(c * areas)[:, None]
        rows += [root * form(n, along1), root * form(n, along2)]
    if b > 0:
        # δq = √A (½ tr(ε) n + δn), and w_t A is the triangle's own area.
        root = np.sqrt(b * surface_areas)[:, None]
        rows += [
            0.5 * root * (strain11 + strain22),
            root * form(n, along1),
            root * form(n, along2),
        ]
    forms = np.stack(rows, axis=1)
    return np.swapaxes(forms, 1, 2) @ forms
