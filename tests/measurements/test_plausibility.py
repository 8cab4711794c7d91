"""Groups of measurements that no adult combines: few adults are accused, and hair is seen."""

import numpy as np
import pytest

from riemhuman.measurements import noise_of_measurements
from riemhuman.measurements.adults import adults
from riemhuman.measurements.plausibility import (
    GROUPS,
    _covariance,
    _means,
    implausible_groups,
    shares_of_adults,
)


def drawn(group, sex, number, rng):
    """Return names, scans of adults with the statistics of ANSUR II, and their deviations."""
    names = ["stature", "body mass", *group.effects]
    deviations = noise_of_measurements(names, 0.4)
    relative = deviations / np.exp(_means(names, sex))
    covariance = _covariance(names, sex) + np.diag(relative**2)
    people = np.exp(rng.multivariate_normal(_means(names, sex), covariance, number))
    return names, people, dict(zip(names, deviations, strict=True))


@pytest.mark.parametrize("group", GROUPS, ids=lambda group: group.name)
def test_few_adults_are_accused_and_most_with_a_reason(group):
    rng = np.random.default_rng(5)
    for sex in ("woman", "man"):
        names, people, deviations = drawn(group, sex, 200, rng)
        effects = np.array([group.effects.get(name, 0.0) for name in names])
        accused = []
        for strength in (0.0, 1.5):
            rows = [
                dict(zip(names, row * np.exp(strength * effects), strict=True)) for row in people
            ]
            found = [implausible_groups(row, deviations, sex) for row in rows]
            accused.append(np.mean([bool(groups) for groups in found]))
        assert accused[0] <= 0.015
        assert accused[1] > 0.5
        assert found[0] == [] or found[0][0].name == group.name


def test_what_is_not_measured_does_not_count():
    group = GROUPS[0]
    mean = dict(zip(adults()["names"], adults()["woman"]["mean"].tolist(), strict=True))
    names = ["stature", "body mass", *group.effects]
    deviations = dict(zip(names, noise_of_measurements(names, 0.4), strict=True))
    hair = {name: mean[name] * np.exp(2.5 * group.effects.get(name, 0.0)) for name in names}
    assert [found.name for found in implausible_groups(hair, deviations, "woman")] == ["head"]
    in_direction, in_any = shares_of_adults(group, hair, deviations, "woman")
    assert in_direction < in_any < 0.001
    unseen = {
        name: value if name in ("stature", "head girth") else np.nan for name, value in hair.items()
    }
    assert implausible_groups(unseen, deviations, "woman") == []
    # Without a stature, groups are compared with those of all adults.
    unknown = hair | {"stature": np.nan, "body mass": np.nan}
    assert [found.name for found in implausible_groups(unknown, deviations, "woman")] == ["head"]
