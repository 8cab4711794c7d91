r"""Terms that are pointwise a cone: elastic metrics weighted by the area of the moving surface.

With s the square root of the area ratio, g = s² ĝ, A = g⁻¹δg and its traceless part A₀,

.. math:: s^2 \left(a \operatorname{tr} A_0^2 + b (\operatorname{tr} A)^2 + c\, |\delta n|^2\right)
          = 16b \left(ds^2 + s^2 d\psi^2\right), \qquad
          d\psi^2 = \frac{a \operatorname{tr}((\hat g^{-1} d\hat g)^2) + c\, |dn|^2}{16b} ,

the metric of a cone of radius 4√b s over H² × S². Hence the distance in closed form, with
L₀ the traceless part of log(g₁⁻¹g₂) and φ the angle of the normals,

.. math:: d^2 = 16b \left(s_1^2 + s_2^2 - 2 s_1 s_2 \cos\min(\pi, \psi)\right), \qquad
          \psi = \frac{\sqrt{a \operatorname{tr} L_0^2 + c\, \varphi^2}}{4\sqrt b} .

With (a, b, c) = (1, λ, 0) this is Theorem 1 of the paper, corrected: K₀ = K − ½ tr(g₁⁻¹K) g₁ and
θ = √(tr((g₁⁻¹K₀)²)/λ)/4. With (0, 1/16, 1) it is the distance of square root normal fields.

ĝ is the point x + iy, x = g₁₂/g₁₁, y = √det g/g₁₁, of the upper half-plane, so that distances need
no logarithm of a matrix: tr L₀² = 2ℓ², where ℓ is the hyperbolic distance of two such points.
"""

from __future__ import annotations

import math

import autograd.numpy as np
import numpy as onp
from autograd.extend import defvjp, primitive

from riemhuman.arrays import Array, Booleans, FeatureRows, Fields, Points
from riemhuman.checks import checked, metric_weight, positive
from riemhuman.kernels.compilation import FUSED, SUM, compiled
from riemhuman.kernels.sphere import sine_cardinal
from riemhuman.kernels.surface import (
    Derivatives,
    dot,
    first_fundamental_form,
    joined_axes,
    square_root,
)
from riemhuman.kernels.threads import CHUNK, LARGEST, SMALLEST, UNDERFLOW, of_one_kind
from riemhuman.terms._polynomial_fits import (
    LARGEST_RATIO,
    NO,
    PRECISION,
    YES,
    Flag,
    excess_at_pi,
    half_angle_fit,
    half_sine_of_share,
    half_sine_squared_and_slope,
    squared_length_and_slope,
)
from riemhuman.terms.normals import add_segment, arc_pair, squared_arc
from riemhuman.terms.term import LENGTH, FieldSpaces, Term


class ConeTerm(Term):
    r"""The elastic metric of stretching, growth and bending, integrated over the moving surface.

    .. math:: w \int_{f(T)} \left(a \operatorname{tr}(A_0^2) + b \operatorname{tr}(A)^2
              + c\, |\delta n|^2\right) dA_f, \qquad A = g^{-1}\delta g

    The fields are x, y and s of g and, if c > 0, the unit normal. Triangles without area are at the
    apex s = 0 of the cone.

    Parameters
    ----------
    weight : float above 0
    a : float
        Weight of stretching without change of area, at least 0.
    b : float
        Weight of the change of area, above 0.
    c : float
        Weight of bending, the rotation of normals; at least 0.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> metric = rh.SurfaceMetric(space, [rh.terms.ConeTerm(1.0, a=1.0, b=1.0, c=0.1)])
    >>> bool(metric.dist(bodies[0], bodies[1]) > 0)
    True
    """

    single = True
    area_power = 1.0

    @checked(a=metric_weight, b=positive, c=metric_weight)
    def __init__(self, weight: float = 1.0, a: float = 1.0, b: float = 1.0, c: float = 1.0) -> None:
        super().__init__(weight)
        self.a, self.b, self.c = a, b, c
        self.n_features = 7 if self.c > 0.0 else 4
        # ψ/ℓ where the normals are the same, and ψ/φ where ĝ is the same.
        self.angle_per_length = math.sqrt(self.a / (8.0 * self.b))
        self.angle_per_turn = math.sqrt(self.c / (16.0 * self.b))

    # Properties, which attributes of subclasses replace, as those of the base class.

    @property
    def is_rotation_invariant(self) -> bool:  # type: ignore[override]  # read only
        return self.c == 0.0

    @property
    def has_target_space(self) -> bool:  # type: ignore[override]  # read only
        return self.c > 0.0

    def target_space(self, spaces: FieldSpaces) -> object:
        if self.c == 0.0:
            return super().target_space(spaces)
        return spaces.metric_and_normal_fields(self.a, self.b, self.c)

    def target_point(self, first: Derivatives) -> Array:
        g, n = first_fundamental_form(first.f_u, first.f_v), self.fields(first)[-1]
        return np.concatenate([joined_axes(g, 3), joined_axes(n, 2)], axis=-1)

    def fields(self, first: Derivatives) -> Fields:
        x, y, s = half_plane(first.e, first.m, first.areas, first.degenerate)
        if self.c == 0.0:
            return x, y, s
        normals = first.area_vectors / first.areas[..., None]
        return x, y, s, np.where(first.degenerate[..., None], _ANY_NORMAL, normals)

    def squared_dist(self, fields_a: Fields, fields_b: Fields) -> Array:
        r"""Return the squared distances, without cancellation for near-equal surfaces.

        .. math:: d^2 = 16b\left((s_1-s_2)^2 + 4 s_1 s_2 \sin^2(\tfrac12\min(\pi,\psi))\right)

        The gradient is 0 where the fields are equal. Where s = 0 or ψ ≥ π, the gradient of ψ is
        taken as 0.
        """
        (x1, y1, s1), (x2, y2, s2) = fields_a[:3], fields_b[:3]
        lengths = squared_hyperbolic_distance(excess(x1, y1, x2, y2))
        squared = (0.5 * self.angle_per_length) ** 2 * lengths
        if self.c > 0.0:
            difference, total = fields_a[3] - fields_b[3], fields_a[3] + fields_b[3]
            turns = squared_arc(dot(difference, difference), dot(total, total))
            squared = squared + (0.5 * self.angle_per_turn) ** 2 * turns
        half = clipped_sine_squared(squared)
        return 16.0 * self.b * ((s1 - s2) ** 2 + 4.0 * s1 * s2 * half)

    def inner_product(self, changes_a: Fields, changes_b: Fields, fields: Fields) -> Array:
        (x1, y1, s1), (x2, y2, s2), (_, y, s) = changes_a[:3], changes_b[:3], fields[:3]
        link = 2.0 * self.a * (x1 * x2 + y1 * y2) / y**2
        if self.c > 0.0:
            link = link + self.c * dot(changes_a[3], changes_b[3])
        return 16.0 * self.b * s1 * s2 + s**2 * link

    def form(self, first: Derivatives) -> Array:
        rows = onp.zeros((5, 6))
        rows[0, [0, 3]] = math.sqrt(2.0 * self.a), -math.sqrt(2.0 * self.a)
        rows[1, [1, 2]] = math.sqrt(2.0 * self.a)
        rows[2, [0, 3]] = 2.0 * math.sqrt(self.b)
        rows[[3, 4], [4, 5]] = math.sqrt(self.c)
        return rows.T @ rows

    def chart(self, fields: Fields) -> Array:
        r"""Map fields to R^{2K} so that Euclidean distances are at most those of the term.

        Let u ∈ R^K hold the logarithm L of ĝ at the identity, in R², times ψ/ℓ or less, and the
        normal times ψ/φ or less. ‖L − L'‖ ≤ ℓ, the hyperbolic plane being of negative curvature,
        and a chord is at most its arc, so z = ‖u − u'‖ ≤ ψ. The coordinates are

        .. math:: 4\sqrt{b/K}\, s\, (e^{i\sqrt K u_1}, \dots, e^{i\sqrt K u_K}) \in C^K .

        cos √t is convex and falls to −1 on [0, π²]: continued by −1 it is convex and never above
        cos √t. By Jensen, (1/K) Σ cos(√K (u_k − u'_k)) ≥ cos min(π, z), and the squared distance
        of coordinates is at most 16b (s² + s'² − 2 s s' cos min(π, ψ)).
        """
        x, y, s = fields[:3]
        parts = []
        if self.a > 0.0:
            # The logarithm lies along the spatial part of the point of the hyperboloid.
            spatial = np.stack([(1.0 - (x**2 + y**2)) / (2.0 * y), x / y], axis=-1)
            size = np.sqrt(np.sum(spatial**2, axis=-1, keepdims=True))
            logarithm = np.arcsinh(size) / np.where(size > 0, size, 1.0) * spatial
            parts.append(min(self.angle_per_length, _STEEPEST) * logarithm)
        if self.c > 0.0:
            parts.append(min(self.angle_per_turn, _STEEPEST) * fields[3])
        if not parts:
            return 4.0 * np.sqrt(self.b) * s[..., None]
        angles = np.concatenate(parts, axis=-1)
        n_angles = angles.shape[-1]
        angles = np.sqrt(n_angles) * angles
        circles = np.concatenate([np.cos(angles), np.sin(angles)], axis=-1)
        return 4.0 * np.sqrt(self.b / n_angles) * s[..., None] * circles

    def pack(self, fields: Fields, areas: Array, kept: FeatureRows) -> float:
        record = onp.zeros((LENGTH, len(areas)))
        x, y, s = fields[:3]
        record[9], record[10] = s**2, s**2 / y
        record[11] = x * record[10]
        if self.c > 0.0:
            record[6:9] = fields[3].T
        return self.pack_record(record, areas, kept)

    def pack_record(self, record: Array, areas: Array, kept: FeatureRows) -> float:
        exact = onp.empty((self.n_features, len(areas)))
        stretch, turn = self.angle_per_length**2, self.angle_per_turn**2
        gap = _pack(of_one_kind(record), of_one_kind(areas), stretch, turn, exact)
        with onp.errstate(over="ignore"):  # the gap is infinite
            kept[:, : len(areas)] = exact
        return 16.0 * self.b * gap

    def squared_distances(self, a: FeatureRows, b: FeatureRows, areas: Array) -> Array:
        real, double, squared = a.dtype.type, PRECISION[a.dtype], np.zeros((len(a), len(b)))
        scale, turn = 0.25 * self.angle_per_length**2, 0.25 * self.angle_per_turn**2
        fit: tuple[float, ...] = ()
        if self.c == 0.0 and self.b <= LARGEST_RATIO * self.a:
            ratio = self.b / self.a
            scale, fit = 1.0 / excess_at_pi(ratio), half_angle_fit(ratio, a.dtype)
        angles = np.zeros(CHUNK, a.dtype)
        _tile(a, b, (real(scale), real(turn)), fit, double, a is b, angles, squared)
        return 16.0 * self.b * squared

    def add_segments(self, records: Array, slopes: Array, areas: Array) -> float:
        # Without a weight of normals, loops are compiled without them, which takes less time.
        turn = 0.25 * self.angle_per_turn**2 if self.c > 0.0 else None
        stretch = 0.25 * self.angle_per_length**2
        return _segments(records, slopes, areas, 16.0 * self.b * self.weight, stretch, turn)


class EbinTerm(ConeTerm):
    r"""w · (Ebin metric), the pull-back by the first fundamental form (equation 2, corrected).

    .. math:: w \int_{f(T)} \left(\operatorname{tr}(A_0^2) + \lambda \operatorname{tr}(A)^2\right)
              dA_f

    Parameters
    ----------
    weight : float above 0
    lam : float
        λ > 0, the weight of changes of area.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> metric = rh.SurfaceMetric(space, [rh.terms.EbinTerm(1.0, lam=1.0)])
    >>> bool(metric.dist(bodies[0], bodies[1]) > 0)
    True
    """

    @checked(lam=positive)
    def __init__(self, weight: float = 1.0, lam: float = 0.5) -> None:
        self.lam = lam
        super().__init__(weight, a=1.0, b=self.lam, c=0.0)

    @property
    def has_target_space(self) -> bool:  # type: ignore[override]  # read only
        return True

    def target_space(self, spaces: FieldSpaces) -> object:
        return spaces.metric_fields(self.lam)

    def target_point(self, first: Derivatives) -> Array:
        return first_fundamental_form(first.f_u, first.f_v)


# Steeper charts give tighter bounds, but wind bodies around in too many dimensions.
_STEEPEST = 18.0

# Replaces the normal of triangles without area, where it has no effect.
_ANY_NORMAL = onp.array([0.0, 0.0, 1.0])


def half_plane(
    e: Array, m: Array, areas: Array, degenerate: Booleans
) -> tuple[Array, Array, Array]:
    """Return the coordinates x, y of ĝ, and s, of g = [[e, m], [m, ...]] with areas √det g."""
    s = np.where(degenerate, 0.0, np.sqrt(areas))
    return np.where(degenerate, 0.0, m / e), areas / e, s


def excess(x1: Array, y1: Array, x2: Array, y2: Array) -> Array:
    """Return cosh ℓ − 1 of two points of the half-plane, without cancellation."""
    return ((x1 - x2) ** 2 + (y1 - y2) ** 2) / (2.0 * y1 * y2)


def hyperbolic_distance(m: Array) -> Array:
    """Return ℓ = 2 arcsinh √(m/2) from m = cosh ℓ − 1."""
    return 2.0 * np.arcsinh(square_root(0.5 * m))


def inverse_hyperbolic_sine_cardinal(x: Array) -> Array:
    """Return x/sinh(x), 1 at 0."""
    safe = np.where(x == 0, 1.0, x)
    # exp(-x) keeps the quotient finite where sinh overflows.
    decay = np.exp(-np.abs(safe))
    return np.where(x == 0, 1.0, 2.0 * np.abs(safe) * decay / -np.expm1(-2.0 * np.abs(safe)))


@primitive
def squared_hyperbolic_distance(m: Array) -> Array:
    """Return ℓ², a smooth function of m = cosh ℓ − 1."""
    return hyperbolic_distance(m) ** 2


defvjp(
    squared_hyperbolic_distance,
    lambda answer, m: (
        lambda upstream: 2.0 * upstream * inverse_hyperbolic_sine_cardinal(hyperbolic_distance(m))
    ),
)


@primitive
def clipped_sine_squared(squared: Array) -> Array:
    """Return sin²(min(½ψ, ½π)), a smooth function of ¼ψ² below ¼π²."""
    return np.sin(np.minimum(0.5 * np.pi, square_root(squared))) ** 2


def _clipped_sine_slope(squared: Array) -> Array:
    angle = 2.0 * square_root(squared)
    return np.where(angle < np.pi, sine_cardinal(angle), 0.0)


defvjp(
    clipped_sine_squared,
    lambda answer, squared: lambda upstream: upstream * _clipped_sine_slope(squared),
)


Point = tuple[float, float, float]


@compiled(forceinline=True, fastmath=FUSED)
def cone_pair(
    a: Point,
    b: Point,
    inverse: float,
    angle: float,
    scale: float,
    fit: tuple[float, ...],
    double: Flag,
) -> tuple[float, Point, Point, float]:
    """Return d²/16b of points (x, y, s) and its slopes by both and by `angle`, for all loops.

    `inverse` is 1/(2 y₁ y₂), `angle` what normals add to ¼ψ², and `scale` is ¼ (ψ/ℓ)². `fit` is
    empty or a `half_angle_fit`, which is faster and leaves no room for normals: then `scale` is
    that of its argument, and there are no slopes. Paths do without it.
    """
    (x1, y1, s1), (x2, y2, s2), real = a, b, type(inverse)
    x, y, s = x1 - x2, y1 - y2, s1 - s2
    m = (x * x + y * y) * inverse
    if len(fit) == 0:
        length, by_length = squared_length_and_slope(m, double)
        half, by_angle = half_sine_squared_and_slope(scale * length + angle, double)
        by_m = by_angle * scale * by_length
    else:
        half, by_m, by_angle = half_sine_of_share(scale * m, fit), real(math.nan), real(math.nan)
    product = real(4.0) * (s1 * s2)
    squared = s * s + product * half
    rate = real(2.0) * inverse * product * by_m
    slopes_a = rate * x, rate * (y - m * y2), real(2.0) * s + real(4.0) * s2 * half
    slopes_b = -rate * x, -rate * (y + m * y1), real(-2.0) * s + real(4.0) * s1 * half
    return squared, slopes_a, slopes_b, product * by_angle


@compiled
def _segments(
    records: Array,
    slopes: Array,
    areas: Array,
    factor: float,
    stretch: float,
    turn: float | None,
) -> float:
    n_times, _, n_faces = records.shape
    # Of each surface x, y and s, and the slopes by them.
    points, added = onp.empty((n_times, 3, n_faces)), onp.zeros((n_times, 3, n_faces))
    for i in range(n_times):
        _half_planes(records[i], points[i])
    total = 0.0
    for i in range(n_times - 1):
        before = points[i], records[i], added[i], slopes[i]
        after = points[i + 1], records[i + 1], added[i + 1], slopes[i + 1]
        total += _segment(before, after, areas, factor, stretch, turn)
    for i in range(n_times):
        _add_slopes(records[i], points[i], added[i], slopes[i])
    return total


@compiled(forceinline=True, fastmath=FUSED)
def _half_planes(record: Array, point: Points) -> None:
    area, e, m = record[9], record[10], record[11]
    x, y, s = point[0], point[1], point[2]
    for t in range(len(area)):
        x[t], y[t], s[t] = _half_plane(area[t], e[t], m[t])


@compiled(forceinline=True, fastmath=SUM)
def _segment(
    before: tuple[Array, ...],
    after: tuple[Array, ...],
    areas: Array,
    factor: float,
    stretch: float,
    turn: float | None,
) -> float:
    """Return the sum of w d²; add its slopes by x, y, s and by normals of both surfaces."""
    points1, record1, by_points1, slopes1 = before
    points2, record2, by_points2, slopes2 = after
    x1, y1, s1 = points1[0], points1[1], points1[2]
    x2, y2, s2 = points2[0], points2[1], points2[2]
    by_x1, by_y1, by_s1 = by_points1[0], by_points1[1], by_points1[2]
    by_x2, by_y2, by_s2 = by_points2[0], by_points2[1], by_points2[2]
    angles, rates = onp.zeros(len(areas)), onp.empty(len(areas))
    # Three loops, because a single one would need too many arrays for vector registers.
    if turn is not None:
        _fill_angles(record1[6:9], record2[6:9], turn, YES, angles, 0, len(areas))
    total = 0.0
    for t in range(len(areas)):
        weight = factor * areas[t]
        a, b = (x1[t], y1[t], s1[t]), (x2[t], y2[t], s2[t])
        inverse = 0.5 / (y1[t] * y2[t])
        squared, by_a, by_b, rate = cone_pair(a, b, inverse, angles[t], stretch, (), YES)
        total += weight * squared
        rates[t] = weight * rate
        by_x1[t] += weight * by_a[0]
        by_y1[t] += weight * by_a[1]
        by_s1[t] += weight * by_a[2]
        by_x2[t] += weight * by_b[0]
        by_y2[t] += weight * by_b[1]
        by_s2[t] += weight * by_b[2]
    if turn is not None:
        add_segment(record1, record2, slopes1, slopes2, rates, turn)
    return total


@compiled(forceinline=True, fastmath=SUM)
def _fill_angles(
    rows: Array,
    columns: Array,
    turn: float,
    double: Flag,
    angles: Array,
    first: int,
    last: int,
) -> None:
    """Fill the part of ¼ψ² due to normals; without their weight, it is already 0."""
    zero = type(turn)(0.0)
    if turn > zero:
        x1, y1, z1, x2, y2, z2 = rows[0], rows[1], rows[2], columns[0], columns[1], columns[2]
        # Unsigned: indices that might count from the end keep loops from being vectorised. Slices
        # of the arrays would do as well but take long to compile.
        start, stop = onp.uintp(first), onp.uintp(last)
        for t in range(start, stop):
            a, b = (x1[t], y1[t], z1[t], zero), (x2[t], y2[t], z2[t], zero)
            angles[t - start] = turn * arc_pair(a, b, NO, double)[0]


@compiled(forceinline=True, fastmath=FUSED)
def _add_slopes(record: Array, point: Points, added: Array, slope: Array) -> None:
    """Add slopes by x, y and s up to slopes by the area ratio, e and m; at the apex are none."""
    e, x, y, s = record[10], point[0], point[1], point[2]
    by_x, by_y, by_s = added[0], added[1], added[2]
    by_area, by_e, by_m = slope[9], slope[10], slope[11]
    for t in range(len(e)):
        inside = s[t] > 0.0
        inverse = 1.0 / e[t] if inside else 0.0
        in_s = 0.5 * by_s[t] / s[t] if inside else 0.0
        by_area[t] += by_y[t] * inverse + in_s
        by_e[t] -= (by_x[t] * x[t] + by_y[t] * y[t]) * inverse
        by_m[t] += by_x[t] * inverse


@compiled(forceinline=True)
def _half_plane(area: float, e: float, m: float) -> tuple[float, float, float]:
    """Return x, y and s; those of the apex where the area is 0."""
    if area > 0.0:
        return m / e, area / e, onp.sqrt(area)
    return 0.0, 1.0, 0.0


@compiled(fastmath=SUM)
def _pack(record: Array, areas: Array, stretch: float, turn: float, exact: Array) -> float:
    """Write x, y, 1/(√2 y), √w s and n; return the squared distance to them in single precision."""
    gap = UNDERFLOW * len(areas)
    for t in range(len(areas)):
        x, y, s = _half_plane(record[9, t], record[10, t], record[11, t])
        h, radius = math.sqrt(0.5) / y, onp.sqrt(areas[t]) * s
        exact[0, t], exact[1, t], exact[2, t], exact[3, t] = x, y, h, radius
        dx, dy, kept = x - onp.float32(x), y - onp.float32(y), float(onp.float32(radius))
        # 4 sin²(½ψ) ≤ ψ², and ℓ² ≤ 2m.
        angle = 2.0 * stretch * (dx * dx + dy * dy) * h * h
        if turn > 0.0:
            chord = 0.0
            for k in range(4, 7):
                exact[k, t] = record[2 + k, t]
                chord += (exact[k, t] - onp.float32(exact[k, t])) ** 2
            # An angle of at most π/2 changes by at most √2 times the change of its chord.
            angle += 2.0 * turn * chord
        step = (radius - kept) ** 2 + radius * kept * min(angle, 4.0)
        inside = (abs(x) < LARGEST) & (y > SMALLEST) & (y < LARGEST) & (radius < LARGEST)
        gap += step if inside else math.inf
    return gap


@compiled(fastmath=SUM)
def _tile(
    a: Array,
    b: Array,
    scales: tuple[float, float],
    fit: tuple[float, ...],
    double: Flag,
    within: bool,
    angles: Array,
    squared: Array,
) -> None:
    """Add sums over triangles, with the scales of `cone_pair` and of squared angles of normals."""
    n_values = a.shape[2]
    scale, turn = scales
    for first in range(0, n_values, CHUNK):
        last = min(first + CHUNK, n_values)
        start, stop = onp.uintp(first), onp.uintp(last)
        for i in range(len(a)):
            x1, y1, h1, s1 = a[i, 0], a[i, 1], a[i, 2], a[i, 3]
            for j in range(i + 1 if within else 0, len(b)):
                x2, y2, h2, s2 = b[j, 0], b[j, 1], b[j, 2], b[j, 3]
                if len(fit) == 0:
                    _fill_angles(a[i, 4:], b[j, 4:], turn, double, angles, first, last)
                total = type(scale)(0.0)
                for t in range(start, stop):
                    one, other = (x1[t], y1[t], s1[t]), (x2[t], y2[t], s2[t])
                    inverse, angle = h1[t] * h2[t], angles[t - start]
                    total += cone_pair(one, other, inverse, angle, scale, fit, double)[0]
                squared[i, j] += total
