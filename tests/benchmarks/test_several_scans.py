"""What several scans of one person are worth: how well values repeat, and changes that are seen.

    pytest tests/benchmarks/test_several_scans.py --benchmark-enable -s

Of simulated people in ten poses, with a millimetre of noise on their vertices, groups of 1, 2 and 4
scans in different poses are measured by `person_in_standard_pose`. It prints the standard deviation
over groups of one person, the error and the slope against the same person made in the standard
pose: medians over the lengths and girths. Then two visits are compared by `compare_visits`, whose
groups are in other poses: how many measurements of unchanged people are called changed, and what is
found of a waist that has grown by 4 cm. Natural people were not made in the standard pose.
"""

import numpy as np
import pytest
from people_whose_flesh_moves import people_whose_flesh_moves

import riemhuman as rh

N_PEOPLE, N_POSES = 6, 10
WAIST = "waist girth (omphalion)"
# Seed and strength of people whose flesh moves; none of them chose anything.
FLESH = [(41, 1.2), (42, 1.2)]
NATURAL_SEED = 8


@pytest.fixture(scope="module")
def measurements():
    return rh.measurements.Measurements(rh.datasets.load_open_model("coarse"))


def scanned(points):
    noise = 0.001 * np.random.default_rng(1).standard_normal(points.shape)
    return (points + noise).reshape(N_PEOPLE, N_POSES, *points.shape[1:])


def groups(n_scans, person):
    """Return disjoint groups of poses."""
    order = np.random.default_rng([person, n_scans]).permutation(N_POSES)
    n_groups = N_POSES // n_scans
    return order[: n_groups * n_scans].reshape(n_groups, n_scans)


def repeated(measurements, scans, n_scans):
    """Return values of groups of scans, shape (n_people, n_groups, M)."""
    straight = [
        [
            rh.measurements.person_in_standard_pose(measurements.definitions, poses[group])
            for group in groups(n_scans, person)
        ]
        for person, poses in enumerate(scans)
    ]
    return measurements.measure(np.array(straight), axes="space", missing="nan").values


def spread(values, is_length):
    deviations = np.sqrt(np.nanmean(np.nanvar(values, axis=1, ddof=1), axis=0))
    return 1e3 * np.median(deviations[is_length])


@pytest.mark.filterwarnings("ignore::riemhuman.errors.ConvergenceWarning")
@pytest.mark.parametrize(("seed", "strength"), FLESH)
def test_people_whose_flesh_moves(benchmark, measurements, seed, strength):
    found = people_whose_flesh_moves(seed, N_PEOPLE, strength)
    grown = people_whose_flesh_moves(seed, N_PEOPLE, strength, waist=0.046)
    scans, later = scanned(found.points), scanned(grown.points)
    at_rest, at_rest_later = (
        measurements.measure(people.at_rest, axes="space", missing="nan").values
        for people in (found, grown)
    )
    waist = measurements.names.index(WAIST)
    true_change = 1e3 * (at_rest_later - at_rest)[:, waist]
    is_length = np.array(measurements.units) == "m"
    print(f"\nseed {seed}, strength {strength:g}; waists grown by {np.median(true_change):.0f} mm")
    spreads = []
    for n_scans in (1, 2, 4):
        values = repeated(measurements, scans, n_scans)
        spreads.append(spread(values, is_length))
        errors = 1e3 * np.sqrt(np.nanmean((values - at_rest[:, None]) ** 2, axis=(0, 1)))
        centred = at_rest - np.nanmean(at_rest, axis=0)
        products = np.nansum(centred * np.nanmean(values, axis=1), axis=0)
        slopes = products / np.nansum(centred**2, axis=0)
        same, changed = [], []
        for person in range(N_PEOPLE):
            first, second = groups(n_scans, person)[:2]
            before = scans[person, first]
            compared = (
                rh.measurements.compare_visits(measurements, before, visit[person, second])
                for visit in (scans, later)
            )
            for results, result in zip((same, changed), compared, strict=True):
                results.append(result)
        false = np.mean([result.is_significant.mean() for result in same])
        told = sum(bool(result.is_significant[waist]) for result in changed)
        seen = 1e3 * np.array([result.changes[waist] for result in changed])
        threshold = 1e3 * np.median([result.thresholds[waist] for result in changed])
        print(
            f"| {n_scans} scans | sd {spreads[-1]:.2f} mm | error "
            f"{np.median(errors[is_length]):.2f} mm | slope {np.median(slopes[is_length]):.3f} | "
            f"{100 * false:.1f} % called changed | waist {np.median(seen):.0f} mm "
            f"({seen.min():.0f} to {seen.max():.0f}), {told} of {N_PEOPLE} told, threshold "
            f"{threshold:.0f} mm |"
        )
    benchmark.pedantic(lambda: None)
    assert spreads[1] < 0.8 * spreads[0]
    assert spreads[2] < 0.8 * spreads[1]


def test_natural_people(benchmark, measurements):
    bodies = rh.datasets.load_open_bodies("coarse", "natural", NATURAL_SEED)
    scans = scanned(bodies.points[: N_PEOPLE * N_POSES])
    is_length = np.array(measurements.units) == "m"
    spreads = [spread(repeated(measurements, scans, n), is_length) for n in (1, 2, 4)]
    print("\nnatural people, sd with 1, 2, 4 scans:", ", ".join(f"{s:.2f} mm" for s in spreads))
    benchmark.pedantic(lambda: None)
    assert spreads[1] < 0.8 * spreads[0]
    assert spreads[2] < 0.8 * spreads[1]
