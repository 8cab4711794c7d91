"""Adults with the measurements of real people: parameters of bodies fitted to ANSUR II.

Each person of ANSUR II (Gordon et al., "2012 Anthropometric Survey of U.S. Army Personnel",
Natick/TR-15/007; measured as Hotzman et al., Natick/TR-11/017, describe) gets one body. What was
not measured differs at random. Soldiers' body mass varies less than the public's, so the body mass
index of everyone is first moved away from the median, as far as in the table of the public below,
and all measurements with it, by their regression on stature and body mass index.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from body_generator import GIVEN, BodyGenerator
from scipy.stats import norm, rankdata

from riemhuman.bodies import joint_motions, rotation_matrix, skin_surface
from riemhuman.datasets import load_open_model
from riemhuman.errors import FileFormatError
from riemhuman.measurements import Length, Measurements, MeasurementSet, open_measurements
from riemhuman.measurements.definitions import DENSITY
from riemhuman.measurements.landmarked_bodies import LandmarkedBodies
from riemhuman.surfaces.nearest_points import nearest_points

SEXES = ("woman", "man")
_FILES = {"woman": "women.csv", "man": "men.csv"}
_PERCENTILES = np.array([5, 10, 15, 25, 50, 75, 85, 90, 95]) / 100.0
# Body mass index of adults, Fryar et al., "Anthropometric reference data for children and adults:
# United States, August 2021-August 2023", Vital Health Stat. 3(50), 2025, table 10, kg/m².
_BODY_MASS_INDEX = {
    "woman": (19.7, 21.5, 22.4, 24.1, 28.3, 34.4, 38.4, 40.9, 44.9),
    "man": (20.9, 22.3, 23.4, 24.9, 28.2, 32.6, 35.1, 37.8, 42.1),
}
_MEDIAN = 4  # where it is among the percentiles
# Mean and spread of gender and age, and the parameters of the distribution of ancestry.
_GENDER = {"woman": 0.95, "man": 0.05}
_GENDER_RANGE = 0.15
_AGE_RANGE = (0.66, 0.93)
_ANCESTRY = (1.0, 0.7, 1.3)

# Measurements that bodies get from people, with the deviation that costs as much as one standard
# deviation of a parameter, as a share of the standard deviation among people of one sex.
_CLOSE = 0.07
_FAIR = 0.15
_LOOSE = 0.35
_SHARES = {
    **dict.fromkeys(
        (
            "stature",
            "chestcircumference",
            "waistcircumference",
            "buttockcircumference",
            "weightkg",
        ),
        _CLOSE,
    ),
    **dict.fromkeys(
        (
            "axillaheight",
            "bicepscircumferenceflexed",
            "bideltoidbreadth",
            "buttockdepth",
            "buttockheight",
            "chestdepth",
            "chestheight",
            "crotchlengthomphalion",
            "footbreadthhorizontal",
            "forearmcircumferenceflexed",
            "heelbreadth",
            "hipbreadth",
            "iliocristaleheight",
            "interscyei",
            "interscyeii",
            "lateralfemoralepicondyleheight",
            "neckcircumferencebase",
            "palmlength",
            "shoulderelbowlength",
            "shoulderlength",
            "tenthribheight",
            "tragiontopofhead",
            "trochanterionheight",
            "verticaltrunkcircumferenceusa",
        ),
        _LOOSE,
    ),
}
# Arms are measured flexed; relaxed they are thinner: shares of the flexed girth.
_RELAXED = {
    "bicepscircumferenceflexed": {"woman": 0.94, "man": 0.925},
    "forearmcircumferenceflexed": {"woman": 0.965, "man": 0.955},
}
# Left out: calipers press where tapes do not; arms hang; eyes are no part of the skin; ears.
_LEFT_OUT = (
    "acromionradialelength",
    "bitragionchinarc",
    "bitragionsubmandibulararc",
    "chestbreadth",
    "crotchlengthposterioromphalion",
    "earbreadth",
    "earlength",
    "earprotrusion",
    "interpupillarybreadth",
    "weightkg",  # faster below
)
_SEATED = ("bideltoidbreadth", "forearmhandlength", "shoulderelbowlength")
_PATH_POINTS = 12

_STEP = 0.06  # of finite differences
_N_STEPS = 5
_N_BINS = 4  # of people by their body mass index, who share derivatives
_BATCH = 25  # bodies measured at a time
_FAILED = 5.0  # largest deviation of a person's measurement, standard deviations


@dataclass(frozen=True)
class Adults:
    """Bodies with the measurements of people, half of them women by their weights."""

    parameters: np.ndarray  # (n, P)
    given: np.ndarray  # (n, 5)
    is_woman: np.ndarray  # (n,)
    wanted: np.ndarray  # (n, M): measurements of the people
    measured: np.ndarray  # (n, M): measurements of the bodies
    names: tuple[str, ...]  # ANSUR's, (M,)
    unwidened: np.ndarray  # (n,): weights with which body mass is spread as in ANSUR


class PeopleFitter:
    """Fits parameters of a generator to measurements of people."""

    def __init__(self, generator: BodyGenerator) -> None:
        self._generator = generator
        standing, seated = (open_measurements("full", pose) for pose in ("standing", "seated"))
        self._poses, names = [], ["weightkg"]
        for definitions, wanted in ((standing, None), (seated, _SEATED)):
            pairs = [
                (entry.equivalents["ANSUR II"].removeprefix("≈ "), entry)
                for entry in definitions.measurements
                if "ANSUR II" in entry.equivalents
                and (
                    not entry.equivalents["ANSUR II"].startswith("≈")
                    or entry.equivalents["ANSUR II"].removeprefix("≈ ") in _RELAXED
                )
            ]
            chosen = [
                (name, entry)
                for name, entry in pairs
                if (name in wanted if wanted else name not in _LEFT_OUT)
            ]
            names += [name for name, _ in chosen]
            definitions = _with_fixed_paths(
                replace(definitions, measurements=[entry for _, entry in chosen])
            )
            self._poses.append(
                (Measurements(definitions), rotation_matrix(definitions.standard_pose_vector))
            )
        self.names = tuple(names)

    def measure(self, parameters: np.ndarray, given: np.ndarray) -> np.ndarray:
        """Return the measurements of bodies, (n, M), NaN where one is not defined."""
        values = np.empty((len(parameters), len(self.names)))
        model = load_open_model("full")
        for first in range(0, len(parameters), _BATCH):
            part = slice(first, first + _BATCH)
            skins = self._generator.bodies(parameters[part], given[part])
            joints = model.joint_regressor @ skins
            rows = []
            for measurements, rotations in self._poses:
                turned = np.broadcast_to(rotations, (len(skins), *rotations.shape))
                motions = joint_motions(joints, turned, model.parents)
                posed = skin_surface(skins, model.weights, joints, *motions)
                rows += [_masses(posed, model.faces)] if not rows else []
                together = LandmarkedBodies(measurements.definitions, posed, "space")
                rows += [entry.value(together) for entry in measurements.definitions.measurements]
            values[part] = np.stack(rows, axis=1)
        return values

    def fit(self, tables: dict[str, np.ndarray], seed: int, n_people: int = 1000) -> Adults:
        """Return bodies of that many people of each sex, rows of its table; see `read_people`."""
        parts = []
        for sex in SEXES:
            people, table = tables[sex], []
            rng = np.random.default_rng([seed, SEXES.index(sex)])
            for name in self.names:
                share = _RELAXED.get(name, {}).get(sex, 1.0)
                table.append(share * people[name] / (10.0 if name == "weightkg" else 1000.0))
            table = np.stack(table, axis=1)
            wanted, unwidened = widened(table, self.names, sex)
            chosen = rng.permutation(len(wanted))[:n_people]
            wanted, unwidened = wanted[chosen], unwidened[chosen]
            tolerances = np.array([_SHARES.get(n, _FAIR) for n in self.names]) * table.std(axis=0)
            mean = self._fit_mean(table.mean(axis=0), tolerances, sex)
            parameters, given, measured = self._fit_people(wanted, tolerances, mean, sex, rng)
            error = np.nan_to_num(np.abs(measured - wanted) / table.std(axis=0), nan=0.0)
            good = error.max(axis=1) < _FAILED
            _say(f"{sex}: {good.sum()} of {len(good)} people have a body with their measurements")
            parts.append(
                Adults(
                    parameters=parameters[good],
                    given=given[good],
                    is_woman=np.full(good.sum(), sex == "woman"),
                    wanted=wanted[good],
                    measured=measured[good],
                    names=self.names,
                    unwidened=unwidened[good],
                )
            )
        return Adults(
            parameters=np.concatenate([part.parameters for part in parts]),
            given=np.concatenate([part.given for part in parts]),
            is_woman=np.concatenate([part.is_woman for part in parts]),
            wanted=np.concatenate([part.wanted for part in parts]),
            measured=np.concatenate([part.measured for part in parts]),
            names=self.names,
            unwidened=np.concatenate([part.unwidened for part in parts]),
        )

    def _fit_mean(self, target: np.ndarray, tolerances: np.ndarray, sex: str) -> np.ndarray:
        given = np.array([_GENDER[sex], np.mean(_AGE_RANGE), *_ANCESTRY])
        start = np.zeros(len(self._generator.names))
        start[:6] = 0.5
        parameters = start
        for _ in range(2 * _N_STEPS):
            value = self.measure(parameters[None], given[None])[0]
            slopes = self._slopes(parameters, given, None)
            step = self._step(slopes, target - value, parameters - start, tolerances)
            parameters = np.clip(parameters + 0.6 * step[0], *self._generator.limits.T)
        return parameters

    def _fit_people(
        self,
        wanted: np.ndarray,
        tolerances: np.ndarray,
        mean: np.ndarray,
        sex: str,
        rng: np.random.Generator,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return parameters, what is given and measurements: random people, moved to be these."""
        n = len(wanted)
        spreads = self._generator.spreads
        limits = self._generator.limits
        given = np.empty((n, len(GIVEN)))
        given[:, 0] = np.abs((sex == "woman") - rng.uniform(0.0, _GENDER_RANGE, n))
        given[:, 1] = rng.uniform(*_AGE_RANGE, n)
        given[:, 2:] = rng.dirichlet(_ANCESTRY, n)
        start = np.clip(mean + spreads * rng.standard_normal((n, len(mean))), *limits.T)
        stature = wanted[:, self.names.index("stature")]
        index = wanted[:, self.names.index("weightkg")] / stature**2
        cuts = np.quantile(index, np.linspace(0, 1, _N_BINS + 1)[1:-1])
        bins = np.searchsorted(cuts, index)

        parameters = 0.3 * start + 0.7 * mean
        best = parameters
        least = np.full(n, np.inf)
        measured = np.full(wanted.shape, np.nan)
        face = None
        for number in range(_N_STEPS + 1):
            values = self.measure(parameters, given)
            misses = np.nan_to_num((wanted - values) / tolerances)
            costs = np.sum(misses**2, axis=1)
            costs += np.sum(((parameters - start) / spreads) ** 2, axis=1)
            better = costs < least
            best = np.where(better[:, None], parameters, best)
            measured = np.where(better[:, None], values, measured)
            least = np.minimum(costs, least)
            _say(f"{sex}, step {number}: median cost {np.median(least):.1f}")
            if number == _N_STEPS:
                break
            misses = np.nan_to_num(wanted - measured)
            parameters = best.copy()
            for bin_number in range(_N_BINS):
                in_bin = np.flatnonzero(bins == bin_number)
                slopes = self._slopes(best[in_bin].mean(axis=0), given[in_bin].mean(axis=0), face)
                face = slopes[:, self._generator.is_of_face]
                step = self._step(slopes, misses[in_bin], best[in_bin] - start[in_bin], tolerances)
                parameters[in_bin] = np.clip(
                    best[in_bin] + (1.0 if number < 3 else 0.6) * step, *limits.T
                )
        return best, given, measured

    def _step(
        self,
        slopes: np.ndarray,
        misses: np.ndarray,
        offsets: np.ndarray,
        tolerances: np.ndarray,
    ) -> np.ndarray:
        """Return Gauss–Newton's steps of people who share the slopes, (n, P)."""
        spreads = self._generator.spreads
        scaled = slopes / tolerances[:, None]
        normal = scaled.T @ scaled + np.diag(spreads**-2)
        right = np.nan_to_num(misses / tolerances) @ scaled - offsets / spreads**2
        return np.linalg.solve(normal, np.atleast_2d(right).T).T

    def _slopes(
        self, parameters: np.ndarray, given: np.ndarray, face: np.ndarray | None
    ) -> np.ndarray:
        """Return derivatives of the measurements by the parameters; those of the face may be known.

        Differences are taken over a step so wide that they see both slopes at a bend.
        """
        of_face = self._generator.is_of_face
        chosen = np.flatnonzero(~of_face) if face is not None else np.arange(len(parameters))
        steps = _STEP * np.eye(len(parameters))[chosen]
        nearby = np.concatenate([parameters + steps, parameters - steps])
        values = self.measure(nearby, np.tile(given, (len(nearby), 1)))
        slopes = np.empty((len(self.names), len(parameters)))
        above, below = np.split(values, 2)
        slopes[:, chosen] = np.nan_to_num(above - below).T / (2.0 * _STEP)
        if face is not None:
            slopes[:, of_face] = face
        return slopes


def read_people(folder: Path) -> dict[str, np.ndarray]:
    """Return the tables of ANSUR II by sex: structured arrays, millimetres and 0.1 kg."""
    tables = {}
    for sex, name in _FILES.items():
        tables[sex] = np.genfromtxt(folder / name, delimiter=",", names=True)
        if "stature" not in (tables[sex].dtype.names or ()):
            raise FileFormatError(f"{folder / name} lacks the column stature of ANSUR II")
    return tables


def public_body_mass_index(normal: np.ndarray, sex: str) -> np.ndarray:
    """Return the logarithm of the public's body mass index at quantiles of the standard normal.

    Beyond the published percentiles it grows as between them.
    """
    places, published = norm.ppf(_PERCENTILES), np.log(_BODY_MASS_INDEX[sex])
    index = np.interp(normal, places, published)
    for end, near, outside in ((0, 1, normal < places[0]), (-1, _MEDIAN, normal > places[-1])):
        slope = (published[end] - published[near]) / (places[end] - places[near])
        index[outside] = published[end] + slope * (normal[outside] - places[end])
    return index


def widened(table: np.ndarray, names: Sequence[str], sex: str) -> tuple[np.ndarray, np.ndarray]:
    """Return measurements with the public's spread of body mass, and weights to undo it."""
    stature = table[:, names.index("stature")]
    mass = table[:, names.index("weightkg")]
    log_index = np.log(mass / stature**2)
    normal = norm.ppf((rankdata(log_index, method="ordinal") - 0.5) / len(log_index))
    offsets = public_body_mass_index(normal, sex)
    widened = offsets - np.log(_BODY_MASS_INDEX[sex][_MEDIAN]) + np.median(log_index)
    predictors = np.stack([np.ones(len(log_index)), np.log(stature), log_index], axis=1)
    slopes = np.linalg.lstsq(predictors, np.log(table), rcond=None)[0][2]
    # The density of ANSUR's index over that of the widened one, at the widened one.
    order = np.argsort(normal)
    stretch = np.empty(len(log_index))
    stretch[order] = np.gradient(widened[order], normal[order]) / log_index.std()
    weights = stretch * norm.pdf((widened - log_index.mean()) / log_index.std()) / norm.pdf(normal)
    return table * np.exp((widened - log_index)[:, None] * slopes), weights


def _with_fixed_paths(definitions: MeasurementSet) -> MeasurementSet:
    """Return a set where lengths on the surface run through points of the mean body's paths."""
    model = load_open_model("full")
    surface = model(pose=definitions.standard_pose_vector)
    landmarks, entries = dict(definitions.landmarks), []
    for entry in definitions.measurements:
        if isinstance(entry, Length) and entry.path == "surface":
            lines = Measurements(replace(definitions, measurements=[entry])).lines(
                surface, axes="space"
            )
            path = np.concatenate(lines[entry.name])
            path = path[np.linspace(0, len(path) - 1, min(len(path), _PATH_POINTS)).astype(int)]
            places, _ = nearest_points(path, surface, model.faces)
            points = [f"{entry.name} {number}" for number in range(len(path))]
            corners = zip(places.triangles, places.barycentric, strict=True)
            landmarks |= {
                point: (model.faces[triangle], weights)
                for point, (triangle, weights) in zip(points, corners, strict=True)
            }
            entry = replace(entry, along=tuple(points), path="straight")
        entries.append(entry)
    return replace(definitions, landmarks=landmarks, measurements=entries)


def _masses(skins: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the masses of bodies, kg, from their volumes."""
    x, y, z = (skins[..., axis][:, faces] for axis in range(3))
    y, z = y[..., 1:] - y[..., :1], z[..., 1:] - z[..., :1]
    normals = y[..., 0] * z[..., 1] - y[..., 1] * z[..., 0]
    return DENSITY / 6.0 * np.sum(normals * x.sum(axis=-1), axis=-1)


def _say(text: str) -> None:
    sys.stderr.write(f"{text}\n")
