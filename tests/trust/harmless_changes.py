"""Changes of the code that no test can notice, since no result depends on them.

`random_changes` passes over them; what is listed here and no longer in the code is an error.
"""

from __future__ import annotations

_ROOM = "room for intermediate results: more does no harm"

# In all files.
SPEED_ALONE_EVERYWHERE = {"n_threads": "threads that share the work: the bits are the same"}

# What sets how fast a right answer is found, and never which: tests must not care. Names are of
# constants, variables, functions or arguments of the file.
SPEED_ALONE = {
    "kernels/triangles.py": {
        "_WORTH_THREADS": "from which size on threads share the work",
        "threaded": "whether threads share the work",
        **dict.fromkeys(("both", "axes", "along"), _ROOM),
    },
    "kernels/turns.py": {
        "_WORTH_THREADS": "from which size on threads share the work",
        "threaded": "whether threads share the work",
        **dict.fromkeys(("axis", "before", "after", "from_axes"), _ROOM),
    },
    "kernels/tiles.py": {
        "n_values": "numbers of one point, by which the work of a tile is counted",
        "LANES": "zeros at the end of rows, which add nothing",
        "CHUNK": "triangles summed before they join the total: rounding errors only",
        "_TILE_WORK": "work of one tile",
        "_TILES_A_THREAD": "tiles that threads share",
        "n_pairs": "pairs of one tile",
        "size": "points on the side of one tile",
    },
    "terms/sum.py": {
        "_WORTH_THREADS": "from which size on threads share the work",
        "_IN_CACHE": "triangles that terms pass over together",
        "threaded": "whether threads share the work",
        "size": "triangles that terms pass over together",
    },
    "terms/half_angle_fit.py": {"_DEGREES": "more terms than needed are no less exact"},
    "kernels/threads.py": {
        "N_CHUNKS": "parts that threads share",
        "_IN_CACHE": "columns multiplied at a time: rounding errors only",
        "_is_large": "from which size on threads share the work",
        "threaded": "whether threads share the work",
    },
    "geometry/pairwise.py": {
        "MEMORY": "features held at once",
        "_BLOCK": "points of one block",
        "_CLOSE_BLOCK": "points of one block of close pairs",
    },
    "geometry/rotation_metric.py": {
        "_AT_A_TIME": "deformations whose images are computed together"
    },
    "solvers/basis_path.py": {
        "gram": "surfaces that a preconditioner is averaged over",
    },
    "solvers/disentangling.py": {
        "_LEAST_AREA": "share of their areas to which hardly any triangle shrinks",
    },
    "solvers/middle_equation.py": {
        "_FAR": "how far a step may go astray before it is taken back; no next point is near it",
    },
    "solvers/minimization.py": {
        "_MEMORY": "steps that the minimiser remembers",
        "_ROUND": "iterations after which a preconditioner is formed anew",
        "refresh": "when the progress bar is drawn",
    },
    "solvers/path_straightening.py": {
        "nodes": "points that a preconditioner is averaged over",
    },
    "solvers/preconditioner.py": {"_RIDGE": "added to the diagonal of a preconditioner"},
    "solvers/spatial_factors.py": {
        "_LARGEST_BLOCK": "up to which size a point is one block of a preconditioner",
        "_N_PROBES": "random vectors that a preconditioner is estimated from",
        "_RIDGE": "added to the diagonal of a preconditioner",
        "_RIDGE_OF_BLOCKS": "added to the diagonal of a preconditioner",
        "one_block": "whether a point is one block of a preconditioner",
        "rng": "random vectors that a preconditioner is estimated from",
    },
    "solvers/streaming_mean.py": {
        "batch_size": "points read at once",
        "sample_size": "points by whose mean the search starts",
    },
    "solvers/quasi_newton.py": {"refresh": "when the progress bar is drawn"},
    "solvers/root_finding.py": {"_MEMORY": "earlier steps that the next one is found from"},
}

_OWN_TIMES = "a path refined to the times that it has is itself"
_TRIALS = "of twenty trials, the last are within a millionth of the first step"
_PRECONDITIONER = "of a preconditioner, which sets how fast an equation is solved"
_UNEQUAL = "unequal weights to try a mean with: any will do"
_START = "what stands there before the first step is never read"
_NO_SIZE = "a matrix of zeros gets a ridge of any size"
_NO_AREA = "triangles without area have no gradient, whatever their slopes"
_RIGHT = "at right angles the sum of two unit vectors is as long as their difference"
_BOUND = "which side of a bound the bound itself is on: no result is known that well"

_ROUNDING = "random errors of the same size, which are as likely of either sign"
_NOT_TAKEN = "what it stands for is not taken"
_DIVIDES_0 = "it divides 0"
_SIGN = "a sign divides as it multiplies"
_ORDER = "another order of elimination solves as well"

_RANDOM_POINT = (
    "def random_point(self, n_samples: int = 1, bound: float = 1.0, rng: Rng = None) -> ndarray:"
)

# By files and lines: changes after which every result is the same, and why. Of several places of
# one kind in a line, the n-th alone is "... #n".
SAME_RESULT: dict[str, dict[str, dict[str, str]]] = {
    "geometry/aligned_surfaces.py": {
        "maps = np.eye(3) + 0.2 * sample_bound(bound) * noise": {
            "Add to Sub": "noise of one sign is as random as of the other"
        },
        "if point.ndim == 3 and len(point) > 2:": {
            "2 changed": "few surfaces are looked at as exactly in the other way",
        },
    },
    "geometry/derived_quantities.py": {
        "scale = 1.0 / np.where(norm == 0.0, 1.0, norm)": {
            "1.0 changed #2": "it divides 1 where the vector is 0, and stays 0"
        },
    },
    "geometry/normal_fields.py": {
        "np.abs(dot(values, values) - 1.0) > 2e-6,": {"Gt to GtE": _BOUND},
        _RANDOM_POINT: {"1.0 changed": "normals are drawn from the whole sphere"},
    },
    "geometry/rotation_fields.py": {
        "return np.all(np.abs(gaps) <= atol, axis=(-2, -1)) & (np.linalg.det(matrices) > 0)": {
            "Gt to GtE": "of an orthogonal matrix it is 1 or -1"
        },
        _RANDOM_POINT: {"1.0 changed": "rotations are drawn from all there are"},
    },
    "geometry/metric_fields.py": {
        "positive = (point[..., 0, 0] > 0) & ~ebin_matrices.is_degenerate(point)": {
            "Gt to GtE": "where it is 0, the matrix is degenerate"
        },
    },
    "geometry/pairwise.py": {
        "if len(parts) < 2:": {"2 changed": "in one call or in two, the features are the same"},
    },
    "kernels/compiled.py": {
        "return njit(nogil=True, **options)(function)": {
            "truth flipped": "whether other threads run meanwhile"
        },
    },
    "kernels/drift.py": {
        "if np.abs(after - before).max() <= _TOLERANCE * size:": {"LtE to Lt": _BOUND},
        "left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]": {"Mult to Div": _SIGN},
    },
    "kernels/elimination.py": {
        "matrix = pattern + sparse.diags_array(1.0 + np.diff(ends))": {"1.0 changed": _ORDER},
        "diag_pivot_thresh=0.0,": {"0.0 changed": _ORDER},
        'options={"SymmetricMode": True},': {"truth flipped": _ORDER},
    },
    "kernels/moving_frames.py": {
        "return 0.5 * math.sqrt(squared) if squared > DEGENERATE * xx * yy else 0.0": {
            "Gt to GtE": _BOUND
        },
    },
    "kernels/rotations.py": {
        "small = squared_angle < _SERIES_BELOW": {"Lt to LtE": _BOUND},
        "x = np.where(small, squared_angle, 0.0)": {"0.0 changed": _NOT_TAKEN},
        "angle = np.sqrt(np.where(small, 1.0, squared_angle))": {"1.0 changed": _NOT_TAKEN},
    },
    "kernels/scalars.py": {
        "safe = np.where(x == 0, 1.0, x)": {"1.0 changed": _NOT_TAKEN},
    },
    "kernels/special_orthogonal.py": {
        "HALF_TURN = np.pi - 8 * np.finfo(float).eps": {
            "8 changed": "the number nearest to it is the same"
        },
        "q = q * np.where(q[..., :1] < 0, -1.0, 1.0)": {
            "1.0 changed": "of a quaternion of any length the logarithm is the same",
            "Mult to Div": _SIGN,
        },
        "safe = np.where(sine > 0, sine, 1.0)": {"1.0 changed": _NOT_TAKEN},
        "left[..., 2] *= onp.sign(onp.linalg.det(left) * onp.linalg.det(right))[..., None]": {
            "Mult to Div": _SIGN
        },
        "scale = np.where(unique, 1.0, 0.0) / np.where(unique, determinant, 1.0)": {
            "1.0 changed #2": _DIVIDES_0
        },
        "near[t] = squares < 6.0 and _fill_cofactors(x, cofactors) > 0.2": {
            "Lt to LtE": _BOUND,
            "Gt to GtE": _BOUND,
            "0.2 changed": "the other way finds the same rotation",
        },
        "largest = 0.0": {"0.0 changed": "all ten rounds are gone, to the same rotation"},
        "if largest < 1e-9:  # quadratic: the rest is rounding": {"Lt to LtE": _BOUND},
    },
    "kernels/sphere.py": {
        "ANTIPODAL = np.pi - 8 * np.finfo(float).eps": {
            "8 changed": "the number nearest to it is the same"
        },
        "shorter = np.where((dot(n1, n2) >= 0)[..., None], n2 - n1, n2 + n1)": {
            "GtE to Gt": _RIGHT
        },
    },
    "kernels/triangles.py": {
        "area = math.sqrt(squared) if squared > DEGENERATE * e * g else 0.0": {"Gt to GtE": _BOUND},
        "for c in range(3):": {"3 changed #2": "the loop over the corners from it on is empty"},
        "scale = 1.0 / areas[t] if has_area else 0.0": {"0.0 changed": _NO_AREA},
    },
    "kernels/turns.py": {
        "vector[0] = 1.0": {"0 changed": "without a turn, any axis will do"},
        "queue = [(0.0, root, root)]": {"0.0 changed": "the root is alone in the queue"},
        "if real < 0.0:": {"Lt to LtE": "a half turn about the opposite axis is the same"},
    },
    "solvers/exponential_derivative.py": {
        "factor = spatial_factor(metric, points[1][None], 1.0)": {
            "1 changed": _PRECONDITIONER,
            "1.0 changed": _PRECONDITIONER,
        },
    },
    "solvers/gradient_descent_mean.py": {
        "if size <= self.tolerance * np.sqrt(variances[-1]):": {"LtE to Lt": _BOUND},
    },
    "solvers/discrete_logarithm.py": {
        "least = within if within.energy <= _WORTH_JOINING * first.energy else first": {
            "LtE to Lt": _BOUND
        },
        "agree = abs(speed - length) <= max(_SAME_SPEED * length, n_steps * rounding)": {
            "LtE to Lt": _BOUND
        },
    },
    "solvers/manifold_checks.py": {
        "near = s.points + _NEAR * np.abs(s.points).max() * s.noise / np.abs(s.noise).max()": {
            "Add to Sub": "noise of one sign is as random as of the other"
        },
        "if np.prod(space.shape) <= _MOST_COORDINATES:": {"LtE to Lt": _BOUND},
    },
    "solvers/parallel_transport.py": {
        "converged = geometry.error <= self.tolerance": {"LtE to Lt": _BOUND},
    },
    "solvers/path_straightening.py": {
        "return np.inf, np.zeros(path[1:-1].size)": {
            "1 changed": "beside an infinite value no slope is looked at",
            "sign or `not` dropped": "beside an infinite value no slope is looked at",
        },
        "if n_segments == len(self._path) - 1:": {
            "1 changed": _OWN_TIMES,
            "Sub to Add": _OWN_TIMES,
        },
    },
    "solvers/poisson_path.py": {
        "parts = interpolator.parts(np.linalg.norm(alike - shorter, axis=1) > np.pi)": {
            "Gt to GtE": _BOUND
        },
        "rivals = [ways for ways in rivals if cost(ways) <= _RIVAL * cost(best)]": {
            "LtE to Lt": _BOUND
        },
    },
    "solvers/preconditioner.py": {
        "ridge = _RIDGE * (np.diag(matrix) + (size if size > 0 else 1.0))": {
            "1.0 changed": _NO_SIZE
        },
    },
    "solvers/quasi_newton.py": {
        "x, values, n_evaluations, newton_was_small = start, np.empty(0), 0, False": {
            "0 changed #1": "all but the last of its numbers are none"
        },
        "self._pairs = np.empty((0, 2))": {"0 changed": _START, "2 changed": _START},
        "is_small = bool(newton <= expected_decrease * value)": {"LtE to Lt": _BOUND},
        "return np.ones(1)": {"1 changed": "the factor is 1, however often it is said"},
        "best = _Trial(0.0, value, x, 0)": {
            "0 changed": "evaluations are counted as they are made"
        },
        "for count in range(1, _MOST_TRIALS + 1):": {
            "1 changed #2": _TRIALS,
            "Add to Sub": _TRIALS,
        },
        "if not new_value <= value + _DECREASE * step * slope:": {"LtE to Lt": _BOUND},
        "step *= float(np.clip(-0.5 * step * slope / excess, 0.1, 0.5))": {
            "0.5 changed #2": "the parabola through a value so high has its least before half way",
        },
        "if new_value < best.value:": {"Lt to LtE": "of two steps to the same value, either"},
        "if new_slope >= _SLOPE_LEFT * slope:": {"GtE to Gt": _BOUND},
    },
    "solvers/rounding.py": {
        "return point * (1.0 + np.random.default_rng(0).uniform(-size, size, point.shape))": {
            "0 changed": _ROUNDING,
            "Add to Sub": _ROUNDING,
            "Mult to Div": _ROUNDING,
        },
    },
    "solvers/solver_checks.py": {
        '"mean": (self.points, np.arange(1.0, len(self.points) + 1)),': {"1.0 changed": _UNEQUAL},
        "return self.points[1]": {"1 changed": "another end to try a path with: any will do"},
        "weights = np.arange(1.0, len(s.points) + 1)": {"1.0 changed": _UNEQUAL},
    },
    "solvers/spatial_factors.py": {
        "if n <= _FEW:": {"LtE to Lt": "both ways solve the same equations"},
        "added = ridge * (diagonal + (size if size > 0 else 1.0))": {"1.0 changed": _NO_SIZE},
        "ridge = _RIDGE_OF_BLOCKS * (sizes + (sizes.mean() if sizes.any() else 1.0))": {
            "1.0 changed": _NO_SIZE
        },
    },
    "terms/ebin.py": {
        "points, added = onp.empty((n_times, 3, n_faces)), onp.zeros((n_times, 3, n_faces))": {
            "3 changed": _ROOM
        },
        "if self.lam <= LARGEST_LAMBDA:": {"LtE to Lt": "there, both ways are exact to rounding"},
        "inside = (abs(x[t]) < LARGEST) & (y[t] > SMALLEST) & (y[t] < LARGEST) & "
        "(radius < LARGEST)": {"Lt to LtE": _BOUND, "Gt to GtE": _BOUND},
        "logarithm = np.arcsinh(size) / np.where(size > 0, size, 1.0) * spatial": {
            "1.0 changed": _DIVIDES_0
        },
    },
    "terms/ebin_geodesics.py": {
        "safe = np.where(straight & (along <= 0), 1.0, along)": {
            "1.0 changed": "there the geodesic has met the apex, and has no end"
        },
        "met_apex = (along <= rounding) & (across <= rounding)": {"LtE to Lt": _BOUND},
    },
    "terms/ebin_transport.py": {
        "safe = np.where(turning, length, 1.0)": {"1.0 changed": _NOT_TAKEN},
    },
    "terms/flat.py": {
        "gap += (vector[k] - kept[k]) ** 2 if abs(vector[k]) < LARGEST else math.inf": {
            "Lt to LtE": _BOUND
        },
    },
    "terms/half_angle_fit.py": {
        "_DOUBLE_SINE = tuple((-4.0) ** k / math.factorial(2 * k + 1) for k in range(15))": {
            "15 changed": "the next term of the series is below 1e-17",
        },
        "return squared * _sine(squared) + real(0.0) * growth": {
            "Add to Sub": "it is 0, or what is infinite makes NaN either way"
        },
    },
    "terms/normal_projection.py": {
        "cancelled = onp.linalg.norm(values_of(sums), axis=-1) <= _CANCELLED * around": {
            "LtE to Lt": _BOUND
        },
        "sums = np.where(unused[..., None], 1.0, sums)": {"1.0 changed": _NOT_TAKEN},
        "self.exist = not onp.any((lengths[..., 0] <= _CANCELLED * around) & (around > 0.0))": {
            "LtE to Lt": _BOUND
        },
        "self._lengths = onp.where(lengths > 0.0, lengths, 1.0)": {"1.0 changed": _DIVIDES_0},
    },
    "terms/normals.py": {
        "by_x1[t] += rate * x * sign": {"Mult to Div #2": _SIGN},
        "by_y1[t] += rate * y * sign": {"Mult to Div #2": _SIGN},
        "by_z1[t] += rate * z * sign": {"Mult to Div #2": _SIGN},
        "half_over_a = np.arctan2(a, b) / np.where(coincident, 1.0, a)": {
            "1.0 changed": _NOT_TAKEN
        },
        "slope = -4.0 * np.arctan2(a, b) * a / (np.where(antipodal, 1.0, b) * (p + q))": {
            "1.0 changed": _NOT_TAKEN
        },
        "acute = x1[t] * x2[t] + y1[t] * y2[t] + z1[t] * z2[t] >= 0.0": {"GtE to Gt": _RIGHT},
        "acute = x1 * x2 + y1 * y2 + z1 * z2 >= real(0.0)": {"GtE to Gt": _RIGHT},
    },
    "terms/root_normals.py": {
        "by_one[9, t] += 0.5 * along1 / s1 if s1 > 0.0 else 0.0": {
            "0.0 changed #2": _NO_AREA,
        },
        "by_other[9, t] -= 0.5 * along2 / s2 if s2 > 0.0 else 0.0": {
            "0.0 changed #2": _NO_AREA,
        },
    },
    "terms/rotations.py": {
        "near = w1 * w2 + x1 * x2 + y1 * y2 + z1 * z2 >= real(0.0)": {"GtE to Gt": _RIGHT},
    },
    "terms/second_order.py": {
        "return self.weight * self.surrounded / np.where(self.surrounded, masses, 1.0)": {
            "1.0 changed": _DIVIDES_0
        },
    },
    "terms/term_checks.py": {
        "_TRIANGLES = np.random.default_rng(0).uniform(-0.3, 0.3, (2, 2, 3, 3))": {
            "0 changed": "any triangles will do",
            "0.3 changed": "any triangles will do",
        },
    },
    "terms/sum.py": {
        "by_vertex.flags.writeable = False  # the kind that loops are compiled for": {
            "truth flipped": "loops are compiled for the other kind as well"
        },
        "triangles.fill_records(other, other_faces, frames, start, end, records[:1])": {
            "1 changed": "one surface fills one of the records"
        },
        "if end - start < size:": {"Lt to LtE": "room is made anew for every part"},
    },
}
