"""Rebuild the statistics of adults' measurements from ANSUR II, or check predictions on people.

    python tutorials/remake/build_statistics.py ANSUR [folder]
    python tutorials/remake/build_statistics.py ANSUR --check [--people 200] [--given NAME ...]

ANSUR is a folder with men.csv and women.csv, tables of the survey of the US Army of 2012 (Hotzman
et al., Natick/TR-11/017, 2011; data of the US government, free to use), or of any people measured
like them. The first command writes measurements_of_adults.json. What the mean adult of the open
body model measures more than ANSUR's is stored as offset. The measurements that ANSUR lacks, such
as the natural waist, are regressed on the others among bodies of the model.

The second command predicts the people of the tables with the statistics that ship and with those
of four fifths of the tables for the other fifth, and prints for each measurement the standard
deviation of the error of the best linear regression on the tables' people, those of predictions
over it, and how many people lie within the stated 90 per cent. Predictions that do not know the sex
are compared with the best linear regression that does not know it either, over women and men alike.
With --people it also makes bodies of so many people of each sex, and measures these.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from unittest.mock import patch

import numpy as np
from numpy import ndarray

from riemhuman.errors import FileError, FileFormatError
from riemhuman.measurements import Measurements, model_from_measurements, open_measurements
from riemhuman.measurements import predicted_measurements as statistics
from riemhuman.measurements.measurement_set import DATA

_TABLES = {"woman": "women.csv", "man": "men.csv"}
# Units of the tables that are not millimetres.
_UNITS = {"weightkg": 0.1, "interpupillarybreadth": 1e-4}
_SOURCE = (
    "Derived from every second person of ANSUR II: 2012 Anthropometric Survey of U.S. Army "
    "Personnel; definitions: Hotzman et al., Natick/TR-11/017, 2011. Work of the US government, in "
    "the public domain."
)
_GIVEN = ["stature", "chest girth", "waist girth (omphalion)", "hip girth"]
_N_BODIES = 300
_SEED = 34
# Least standard deviation, by the mean, of measurements that ANSUR lacks given others: the model
# says less than 1 per cent, but where a natural waist is differs among people of one shape.
_LEAST_SPREAD = 0.03
_WITHIN = 1.6449  # standard deviations within which 90 per cent lie


def main(arguments: Sequence[str] | None = None) -> None:
    """Build or check."""
    parser = argparse.ArgumentParser(description="Statistics of adults' measurements.")
    parser.add_argument("ansur", type=Path, help="folder with men.csv and women.csv")
    parser.add_argument("folder", nargs="?", type=Path, default=DATA)
    parser.add_argument("--check", action="store_true", help="check predictions, write nothing")
    parser.add_argument(
        "--people", type=int, default=0, help="people of each sex to make bodies of"
    )
    parser.add_argument("--given", nargs="+", default=_GIVEN, help="names of given measurements")
    options = parser.parse_args(arguments)
    names, people = read_people(options.ansur)
    if options.check:
        check(names, people, options.given, options.people)
        return
    record = build(names, people)
    path = options.folder / "measurements_of_adults.json"
    path.write_text(json.dumps(record, indent=0) + "\n", encoding="utf-8")
    sys.stdout.write(f"{path}: {len(record['names'])} measurements\n")


def read_people(folder: Path) -> tuple[list[str], dict[str, ndarray]]:
    """Return names of measurements and by sex their values, shape (n, M), metres or kilograms."""
    columns = {
        measurement.name: measurement.equivalents["ANSUR II"].removeprefix("≈ ")
        for pose in ("standing", "seated")
        for measurement in open_measurements("coarse", pose).measurements
        if "ANSUR II" in measurement.equivalents
    }
    people = {}
    for sex, file in _TABLES.items():
        path = folder / file
        if not path.is_file():
            raise FileError(f"{path} does not exist; it must hold the table of {file[:-4]}")
        rows = [line.split(",") for line in path.read_text(encoding="utf-8").splitlines()]
        missing = sorted(set(columns.values()) - set(rows[0]))
        if missing:
            raise FileFormatError(f"{path} has no columns {missing}")
        places = [rows[0].index(column) for column in columns.values()]
        units = np.array([_UNITS.get(column, 1e-3) for column in columns.values()])
        people[sex] = np.array([[float(row[k]) for k in places] for row in rows[1:]]) * units
    return list(columns), people


def build(names: list[str], people: dict[str, ndarray]) -> dict[str, object]:
    """Return the record of the file."""
    standing = open_measurements("full")
    seated = open_measurements("full", pose="seated")
    measurements, sitting = Measurements(standing), Measurements(seated)
    lacking = [name for name in measurements.names if name not in names]
    model = standing.model
    record = {"source": _SOURCE, "names": [*names, *lacking]}
    shared = [name for name in names if name in measurements.names]
    of_shared = [measurements.names.index(name) for name in shared]
    of_lacking = [measurements.names.index(name) for name in lacking]
    in_names = [names.index(name) for name in shared]
    bodies_of = json.loads((DATA / "adults.json").read_text(encoding="utf-8"))
    for sex, values in people.items():
        mean, covariance = values.mean(axis=0), np.cov(values.T)
        std = np.sqrt(np.diag(covariance))
        entry = bodies_of[f"{sex} of ANSUR II"]
        rng = np.random.default_rng(_SEED)
        betas = rng.multivariate_normal(entry["mean"], entry["covariance"], _N_BODIES)
        points = model(betas, standing.standard_pose_vector)
        measured = measurements.measure(points, axes="space", missing="nan").values
        measured = measured[np.isfinite(measured).all(axis=1)]
        # Regression with errors in the variables, a twentieth of the spread among adults.
        x = (measured[:, of_shared] - measured[:, of_shared].mean(axis=0)) / std[in_names]
        y = measured[:, of_lacking] - measured[:, of_lacking].mean(axis=0)
        ridge = 0.05 * len(x) * np.eye(len(shared))
        slopes = np.linalg.solve(x.T @ x + ridge, x.T @ y) / std[in_names, np.newaxis]
        typical = np.array(entry["mean"])
        of_mean = measurements.measure(
            model(typical, standing.standard_pose_vector), axes="space"
        ).values
        on_chair = sitting.measure(model(typical, seated.standard_pose_vector), axes="space")
        rest = np.cov((y - x @ (slopes * std[in_names, np.newaxis])).T)
        rest += np.diag((_LEAST_SPREAD * of_mean[of_lacking]) ** 2)
        cross = slopes.T @ covariance[in_names]
        both = np.block([[covariance, cross.T], [cross, cross[:, in_names] @ slopes + rest]])
        spread = np.sqrt(np.diag(both))
        correlations = (both / np.outer(spread, spread))[np.tril_indices(len(both), -1)]
        offsets = dict(zip(shared, of_mean[of_shared] - mean[in_names], strict=True))
        offsets |= {n: value - mean[names.index(n)] for n, value in on_chair.to_dict().items()}
        record[sex] = {
            "people": len(values),
            "mean": _rounded([*mean, *of_mean[of_lacking]]),
            "std": _rounded(spread),
            "offsets": {name: round(float(value), 5) for name, value in offsets.items()},
            "correlations": _rounded(correlations),
        }
    return record


def _rounded(values: Sequence[float] | ndarray) -> list[float]:
    return [round(float(value), 5) for value in values]


def check(names: list[str], people: dict[str, ndarray], given: list[str], n_people: int) -> None:
    """Print how good predictions are."""
    rows = np.array([names.index(name) for name in given])
    rest = np.setdiff1d(np.arange(len(names)), rows)
    unknown = _ratio_without_sex(names, people, given, rows, rest)
    for sex, values in people.items():
        errors, within, flagged = _predicted(names, values, given, sex)
        folds = np.random.default_rng(_SEED).permutation(len(values)) % 5
        crossed, crossed_within = np.empty_like(errors), np.empty_like(within)
        regression = np.empty_like(errors)
        for fold in range(5):
            learnt, kept = values[folds != fold], values[folds == fold]
            mean, covariance = learnt.mean(axis=0), np.cov(learnt.T)
            learnt_from = {"names": names, sex: {"mean": mean, "covariance": covariance}}
            with patch.object(statistics, "adults", lambda record=learnt_from: record):
                crossed[folds == fold], crossed_within[folds == fold], _ = _predicted(
                    names, kept, given, sex
                )
            x = np.column_stack([np.ones(len(learnt)), learnt[:, rows]])
            slopes = np.linalg.lstsq(x, learnt[:, rest], rcond=None)[0]
            fitted = np.column_stack([np.ones(len(kept)), kept[:, rows]]) @ slopes
            regression[folds == fold] = fitted - kept[:, rest]
        bodies = _of_bodies(names, values[:n_people], given, sex) if n_people else None
        best = regression.std(axis=0)
        ratio = errors.std(axis=0) / best
        sys.stdout.write(
            f"\n{len(values)} people, {sex}; given {', '.join(given)}: "
            f"{100 * flagged.mean():.2f} % called contradictory\n"
            f"{'':36}{'regression':>11}{'crossed':>9}{'shipped':>9}"
            f"{'sex unknown':>13}{'within 90 %':>13}{'body':>8}\n"
        )
        for k, column in enumerate(rest):
            body = "" if bodies is None else f"{bodies[:, k].std() / best[k]:8.2f}"
            sys.stdout.write(
                f"{names[column]:36}{1000 * best[k]:8.1f} mm"
                f"{crossed[:, k].std() / best[k]:9.3f}{ratio[k]:9.3f}{unknown[k]:13.3f}"
                f"{100 * crossed_within[:, k].mean():13.1f}{body}\n"
            )


def _predicted(
    names: list[str], values: ndarray, given: list[str], sex: str
) -> tuple[ndarray, ndarray, ndarray]:
    """Return errors of predictions, whether they are within 90 per cent, and contradictions."""
    errors, within, flagged = [], [], []
    rest = [name for name in names if name not in given]
    for row in values:
        person = dict(zip(names, row, strict=True))
        prediction = statistics.predict({name: person[name] for name in given}, sex)
        error = np.array([prediction.mean[name] - person[name] for name in rest])
        errors.append(error)
        within.append(np.abs(error) < _WITHIN * np.array([prediction.std[name] for name in rest]))
        flagged.append(bool(prediction.contradictory))
    return np.array(errors), np.array(within), np.array(flagged)


def _ratio_without_sex(
    names: list[str], people: dict[str, ndarray], given: list[str], rows: ndarray, rest: ndarray
) -> ndarray:
    """Return errors without the sex over those of a regression; both sexes have equal weight."""
    guessed = [_predicted(names, values, given, "adult")[0] for values in people.values()]
    scales = [np.full((len(values), 1), len(values) ** -0.5) for values in people.values()]
    scale, values = np.concatenate(scales), np.concatenate(list(people.values()))
    x = scale * np.column_stack([np.ones(len(values)), values[:, rows]])
    y = scale * values[:, rest]
    residuals = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]
    errors = scale * np.concatenate(guessed)
    return np.linalg.norm(errors, axis=0) / np.linalg.norm(residuals, axis=0)


def _of_bodies(names: list[str], values: ndarray, given: list[str], sex: str) -> ndarray:
    """Return errors of what the bodies measure; NaN for seated measurements."""
    measurements = Measurements(open_measurements("coarse"))
    rest = [name for name in names if name not in given]
    errors = np.full((len(values), len(rest)), np.nan)
    for number, row in enumerate(values):
        person = dict(zip(names, row, strict=True))
        model_fit = model_from_measurements(
            {name: person[name] for name in given}, sex, resolution="coarse"
        )
        measured = measurements.measure(model_fit.points, axes="space", missing="nan").to_dict()
        for k, name in enumerate(rest):
            errors[number, k] = measured.get(name, np.nan) - person[name]
    return errors


if __name__ == "__main__":
    main()
