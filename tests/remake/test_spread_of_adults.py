"""People drawn from the open body model have the measurements of real people."""

import json

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.measurements.measurement_set import DATA

# Means and standard deviations of ANSUR II, of women and of men, metres and kg: Gordon et al.,
# "2012 Anthropometric Survey of U.S. Army Personnel", Natick/TR-15/007.
ANSUR = {
    "stature": ((1.627, 0.062), (1.756, 0.069)),
    "inside leg height": ((0.781, 0.044), (0.846, 0.047)),
    "waist height (omphalion)": ((0.979, 0.049), (1.057, 0.053)),
    "arm span": ((1.658, 0.082), (1.816, 0.086)),
    "chest girth": ((0.949, 0.084), (1.060, 0.088)),
    "waist girth (omphalion)": ((0.865, 0.101), (0.942, 0.112)),
    "hip girth": ((1.023, 0.075), (1.021, 0.076)),
    "thigh girth": ((0.617, 0.055), (0.626, 0.058)),
    "calf girth": ((0.374, 0.028), (0.393, 0.029)),
    "shoulder (biacromial) breadth": ((0.365, 0.019), (0.416, 0.019)),
    "foot length": ((0.246, 0.012), (0.271, 0.013)),
    "body mass": ((68.01, 10.95), (85.77, 14.25)),
}
CORRELATIONS = {
    ("stature", "inside leg height"): (0.85, 0.85),
    ("stature", "body mass"): (0.54, 0.48),
    ("stature", "waist girth (omphalion)"): (0.25, 0.22),
    ("chest girth", "waist girth (omphalion)"): (0.84, 0.89),
    ("waist girth (omphalion)", "body mass"): (0.84, 0.89),
    ("thigh girth", "calf girth"): (0.75, 0.79),
}


def drawn(group, resolution, names, n):
    """Return measurements of people drawn from a group of adults."""
    record = json.loads((DATA / "adults.json").read_text(encoding="utf-8"))[group]
    betas = np.random.default_rng(0).multivariate_normal(record["mean"], record["covariance"], n)
    model = rh.datasets.load_open_model(resolution)
    definitions = rh.measurements.open_measurements(model).with_measurements(names)
    bodies = model(betas, definitions.standard_pose_vector)
    return rh.measurements.Measurements(definitions).measure(bodies, axes="space", missing="nan")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sex", "resolution"),
    [
        ("woman", "coarse"),
        pytest.param("woman", "full", marks=pytest.mark.slow),
        pytest.param("man", "full", marks=pytest.mark.slow),
    ],
)
def test_drawn_people_have_the_spread_of_ansur(sex, resolution):
    which = ("woman", "man").index(sex)
    people = drawn(f"{sex} of ANSUR II", resolution, list(ANSUR), 120)
    assert np.isnan(people.values).mean() < 0.005
    for name, rows in ANSUR.items():
        mean, spread = rows[which]
        assert abs(np.nanmean(people[name]) - mean) < 0.6 * spread, name
        assert 0.8 < np.nanstd(people[name]) / spread < 1.2, name
    for pair, expected in CORRELATIONS.items():
        values = np.stack([people[name] for name in pair])
        values = values[:, np.isfinite(values).all(axis=0)]
        assert abs(np.corrcoef(values)[0, 1] - expected[which]) < 0.2, pair


@pytest.mark.parametrize(
    ("sex", "published"), [("woman", (19.7, 28.3, 44.9)), ("man", (20.9, 28.2, 42.1))]
)
def test_body_mass_of_the_public_is_spread_wider(sex, published):
    indices = []
    for group in (sex, f"{sex} of ANSUR II"):
        people = drawn(group, "coarse", ["stature", "body mass"], 150)
        indices.append(people["body mass"] / people["stature"] ** 2)
    public, soldiers = (np.quantile(index, (0.05, 0.5, 0.95)) for index in indices)

    def spread(percentiles):
        return (percentiles[2] - percentiles[0]) / percentiles[1]

    # NHANES, August 2021 to August 2023: Vital Health Stat. 3(50), table 10.
    assert 0.75 < spread(public) / spread(published) < 1.15
    assert spread(soldiers) < 0.8 * spread(public)
    assert abs(public[1] / soldiers[1] - 1.0) < 0.06
