"""Compiled loops for bulk work; they must agree with the definitions in the other kernels.

Importing this module compiles nothing: functions compile at first call and are cached on disk.
They release the interpreter lock and run in Python's own threads over a fixed number of chunks of
triangles, so that results do not depend on the number of threads, and no thread waits in a busy
loop as those of numba's parallel mode do.
"""

from __future__ import annotations

import math

import numpy as np
from numpy import ndarray

from riemhuman.kernels.compilation import njit
from riemhuman.kernels.surface import DEGENERATE
from riemhuman.kernels.threads import in_chunks

# Below this many triangles times surfaces, threads cost more than they bring.
_WORTH_THREADS = 50_000


@njit(inline="always")
def _squared_arc(p: float, q: float) -> tuple[float, float]:
    """Return θ² and dθ²/dp = θ/sin θ of unit vectors n, m with p = ‖n − m‖² and q = ‖n + m‖²."""
    if p < 0.04:
        # 2 Σ pᵏ/(k² binom(2k, k)); the next term is below rounding error.
        value = p * (
            1 + p * (1 / 12 + p * (1 / 90 + p * (1 / 560 + p * (1 / 3150 + p * (1 / 16632)))))
        )
        slope = 1 + p * (
            1 / 6 + p * (1 / 30 + p * (1 / 140 + p * (1 / 630 + p * (6 / 16632 + p / 12012))))
        )
        return value, slope
    a, b = math.sqrt(p), math.sqrt(q)
    theta = 2.0 * math.atan2(a, b)
    # Cut off where the derivative no longer exists, at antipodal vectors.
    return theta * theta, (2.0 * theta / (a * b) if b > 0.0 else 0.0)


@njit(inline="always")
def _half_angle(m: float, kappa: float) -> tuple[float, float]:
    """Return sin²(½ min(π, θ)) and its slope in m = cosh ℓ − 1, where θ = κℓ."""
    if m < 0.02:
        # ℓ² and its slope as power series in m.
        squared = m * (2 + m * (-1 / 3 + m * (4 / 45 + m * (-1 / 35 + m * (16 / 1575)))))
        squared += m**6 * (-8 / 2079 + m * (32 / 21021))
        slope = 2 + m * (-2 / 3 + m * (4 / 15 + m * (-4 / 35 + m * (16 / 315))))
        slope += m**5 * (-16 / 693 + m * (32 / 3003))
        if kappa * kappa * squared < 0.05:
            t = kappa * kappa * squared
            value = t * (1 / 4 + t * (-1 / 48 + t * (1 / 1440 + t * (-1 / 80640 + t / 7257600))))
            rate = 1 / 4 + t * (-1 / 24 + t * (1 / 480 + t * (-1 / 20160 + t / 1451520)))
            return value, rate * kappa * kappa * slope
        length = math.sqrt(squared)
        ratio = 0.5 * slope
    else:
        length = 2.0 * math.asinh(math.sqrt(0.5 * m))
        ratio = length / math.sqrt(m * (m + 2.0))
    theta = kappa * length
    if theta >= math.pi:
        return 1.0, 0.0
    half = math.sin(0.5 * theta)
    slope = 0.5 * kappa * kappa * math.sin(theta) / theta * ratio
    return half * half, slope


@njit(nogil=True)
def _squared_segments(
    path: ndarray,
    faces: ndarray,
    frames: ndarray,
    areas: ndarray,
    first: int,
    last: int,
    a: float,
    lam: float,
    c: float,
    b: float,
    gradient: ndarray,
) -> float:
    """Sum d² over all segments and triangles `first` to `last`; add its gradient."""
    n_times = path.shape[1]
    kappa = 0.5 / math.sqrt(2.0 * lam) if a > 0.0 else math.nan
    fu = np.empty((n_times, 3))
    fv, normal, normal_slope = np.empty_like(fu), np.empty_like(fu), np.empty_like(fu)
    area, e = np.empty(n_times), np.empty(n_times)
    x, y, s = np.empty(n_times), np.empty(n_times), np.empty(n_times)
    slope_x, slope_y, slope_s = np.empty(n_times), np.empty(n_times), np.empty(n_times)
    total = 0.0
    for t in range(first, last):
        one, two, three = faces[t, 0], faces[t, 1], faces[t, 2]
        scale_u, scale_v, skew = frames[t, 0], frames[t, 1], frames[t, 2]
        weight = areas[t]
        for i in range(n_times):
            for k in range(3):
                edge = path[two, i, k] - path[one, i, k]
                fu[i, k] = edge * scale_u
                fv[i, k] = (path[three, i, k] - path[one, i, k]) * scale_v - edge * skew
            normal[i, 0] = fu[i, 1] * fv[i, 2] - fu[i, 2] * fv[i, 1]
            normal[i, 1] = fu[i, 2] * fv[i, 0] - fu[i, 0] * fv[i, 2]
            normal[i, 2] = fu[i, 0] * fv[i, 1] - fu[i, 1] * fv[i, 0]
            squared = normal[i, 0] ** 2 + normal[i, 1] ** 2 + normal[i, 2] ** 2
            e[i] = fu[i, 0] ** 2 + fu[i, 1] ** 2 + fu[i, 2] ** 2
            g = fv[i, 0] ** 2 + fv[i, 1] ** 2 + fv[i, 2] ** 2
            mixed = fu[i, 0] * fv[i, 0] + fu[i, 1] * fv[i, 1] + fu[i, 2] * fv[i, 2]
            if squared <= DEGENERATE * e[i] * g:
                area[i], e[i], x[i], y[i], s[i] = 0.0, 1.0, 0.0, 1.0, 0.0
                if c > 0.0:
                    total = math.inf
                for k in range(3):
                    normal[i, k] = 0.0
            else:
                area[i] = math.sqrt(squared)
                x[i], y[i], s[i] = mixed / e[i], area[i] / e[i], math.sqrt(area[i])
                for k in range(3):
                    normal[i, k] /= area[i]
            slope_x[i] = slope_y[i] = slope_s[i] = 0.0
            for k in range(3):
                normal_slope[i, k] = 0.0
        for i in range(n_times - 1):
            j = i + 1
            if a > 0.0:
                dx, dy, ds = x[i] - x[j], y[i] - y[j], s[i] - s[j]
                yy = y[i] * y[j]
                m = 0.5 * (dx * dx + dy * dy) / yy
                half, rate = _half_angle(m, kappa)
                factor = 16.0 * lam * a * weight
                total += factor * (ds * ds + 4.0 * s[i] * s[j] * half)
                slope_s[i] += factor * (2.0 * ds + 4.0 * s[j] * half)
                slope_s[j] += factor * (-2.0 * ds + 4.0 * s[i] * half)
                rate *= factor * 4.0 * s[i] * s[j]
                slope_x[i] += rate * dx / yy
                slope_x[j] -= rate * dx / yy
                slope_y[i] += rate * (dy / yy - m / y[i])
                slope_y[j] -= rate * (dy / yy + m / y[j])
            if c > 0.0:
                chord = opposite = 0.0
                for k in range(3):
                    chord += (normal[i, k] - normal[j, k]) ** 2
                    opposite += (normal[i, k] + normal[j, k]) ** 2
                value, rate = _squared_arc(chord, opposite)
                total += c * weight * value
                rate *= 2.0 * c * weight
                for k in range(3):
                    if chord <= opposite:
                        step = rate * (normal[j, k] - normal[i, k])
                        normal_slope[i, k] -= step
                        normal_slope[j, k] += step
                    else:
                        # The same but for multiples of the normals, which have no effect: near
                        # antipodal normals the difference is hardly anything else.
                        step = rate * (normal[j, k] + normal[i, k])
                        normal_slope[i, k] -= step
                        normal_slope[j, k] -= step
            if b > 0.0:
                for k in range(3):
                    step = s[i] * normal[i, k] - s[j] * normal[j, k]
                    total += b * weight * step * step
                    step *= 2.0 * b * weight
                    slope_s[i] += step * normal[i, k]
                    slope_s[j] -= step * normal[j, k]
                    normal_slope[i, k] += step * s[i]
                    normal_slope[j, k] -= step * s[j]
        for i in range(n_times):
            if area[i] == 0.0:
                continue
            slope_e = -(slope_x[i] * x[i] + slope_y[i] * y[i]) / e[i]
            slope_m = slope_x[i] / e[i]
            slope_area = slope_y[i] / e[i] + 0.5 * slope_s[i] / s[i]
            radial = 0.0
            for k in range(3):
                radial += normal[i, k] * normal_slope[i, k]
            n0 = slope_area * normal[i, 0] + (normal_slope[i, 0] - radial * normal[i, 0]) / area[i]
            n1 = slope_area * normal[i, 1] + (normal_slope[i, 1] - radial * normal[i, 1]) / area[i]
            n2 = slope_area * normal[i, 2] + (normal_slope[i, 2] - radial * normal[i, 2]) / area[i]
            for k in range(3):
                # fv × N' and N' × fu, component k, with N' the slope in f_u × f_v.
                if k == 0:
                    from_u = fv[i, 1] * n2 - fv[i, 2] * n1
                    from_v = n1 * fu[i, 2] - n2 * fu[i, 1]
                elif k == 1:
                    from_u = fv[i, 2] * n0 - fv[i, 0] * n2
                    from_v = n2 * fu[i, 0] - n0 * fu[i, 2]
                else:
                    from_u = fv[i, 0] * n1 - fv[i, 1] * n0
                    from_v = n0 * fu[i, 1] - n1 * fu[i, 0]
                in_u = 2.0 * slope_e * fu[i, k] + slope_m * fv[i, k] + from_u
                in_v = slope_m * fu[i, k] + from_v
                at_two = scale_u * in_u - skew * in_v
                at_three = scale_v * in_v
                gradient[two, i, k] += at_two
                gradient[three, i, k] += at_three
                gradient[one, i, k] -= at_two + at_three
    return total


def path_energy(
    path: ndarray,
    faces: ndarray,
    frames: ndarray,
    areas: ndarray,
    *,
    a: float = 0.0,
    lam: float = 1.0,
    c: float = 0.0,
    b: float = 0.0,
) -> tuple[float, ndarray]:
    """Return the closed-form path energy n Σ d²(f_i, f_{i+1}) and its gradient, in one pass.

    Parameters
    ----------
    path : array, shape (n_times, V, 3)
        Surfaces f_i.
    faces : array of int, shape (F, 3)
        Triangles.
    frames : array, shape (F, 3)
        Template frames: 1/u₂, 1/v₃, u₃/(v₃u₂).
    areas : array, shape (F,)
        Template areas w_t.
    a, lam, c : float
        Weights of the elastic metric.
    b : float
        Weight of the square root normal field metric.

    Returns
    -------
    energy : float
        Infinite where c > 0 and a surface has a triangle without area.
    gradient : array, shape (n_times, V, 3)
        Gradient with respect to all surfaces, 0 in triangles without area.
    """
    # Vertex by vertex, all times together: what one triangle reads lies close together.
    by_vertex = np.ascontiguousarray(np.swapaxes(path, 0, 1))

    def run(first: int, last: int) -> tuple[float, ndarray]:
        slopes = np.zeros(by_vertex.shape)
        value = _squared_segments(
            by_vertex, faces, frames, areas, first, last, a, lam, c, b, slopes
        )
        return value, slopes

    parts = in_chunks(run, len(faces), threaded=len(faces) * len(path) > _WORTH_THREADS)
    n_segments = len(path) - 1
    gradient = n_segments * sum(slopes for _, slopes in parts)
    energy = n_segments * sum(value for value, _ in parts)
    return energy, np.ascontiguousarray(np.swapaxes(gradient, 0, 1))
