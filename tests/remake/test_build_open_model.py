"""Building the open model, as far as it goes without the packages and tables it is built from."""

import adult_people
import build_open_model
import numpy as np
import pytest
from body_generator import BodyGenerator

from riemhuman.datasets import load_open_model

LEVELS = ("muscle", "weight", "height", "proportions", "cupsize", "firmness")


@pytest.fixture(scope="module")
def generator():
    """Return a generator of three shapes and one local change, all at random."""
    products = np.zeros((3, 26))
    products[0, [3, 12, 14]] = 1  # men of most muscle and average weight
    products[1, 0] = 1  # all of the first ancestry
    products[2, [4, 16]] = 1  # short women
    rng = np.random.default_rng(0)
    shapes = rng.standard_normal((5, 27)).astype(np.float32)
    template = rng.standard_normal((9, 3))
    return BodyGenerator(template, shapes, products, ("neck-fat-incr",), np.zeros((0, 3), int))


def weights(generator, gender, change=0.0, **levels):
    """Return the weights of the shapes in a body."""
    parameters = [[*(dict.fromkeys(LEVELS, 0.5) | levels).values(), change]]
    given = np.array([[gender, 0.8, 1.0, 2.0, 1.0]])
    offsets = generator.bodies(np.array(parameters), given)[0] - generator.template
    return np.linalg.lstsq(generator.shapes.T.astype(float), offsets.ravel(), rcond=None)[0]


@pytest.mark.parametrize(
    ("gender", "change", "levels", "expected"),
    [
        (0.0, 0.0, {"muscle": 1.0}, [1.0, 0.25, 0.0, 0.0, 0.0]),
        (0.0, 0.0, {"muscle": 0.5}, [0.0, 0.25, 0.0, 0.0, 0.0]),
        (0.25, 0.0, {"muscle": 0.75, "weight": 0.75}, [0.1875, 0.25, 0.125, 0.0, 0.0]),
        (1.0, 0.4, {"height": 0.2}, [0.0, 0.25, 0.8, 0.4, 0.0]),
        (1.0, -0.3, {"height": -0.2}, [0.0, 0.25, 1.2, 0.0, 0.3]),  # beyond the end
    ],
)
def test_shapes_of_phenotypes_multiply(generator, gender, change, levels, expected):
    found = weights(generator, gender, change, **levels)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-5)


def people(n, names, rng):
    """Return a table of people whose girth follows their mass."""
    stature = rng.normal(1.7, 0.07, n)
    mass = 25.0 * stature**2 * np.exp(rng.normal(0.0, 0.13, n))
    girth = 0.9 * (mass / 70.0) ** 0.6 * np.exp(rng.normal(0.0, 0.02, n))
    return np.stack([{"stature": stature, "weightkg": mass}.get(k, girth) for k in names], axis=1)


class LinearFitter(adult_people.PeopleFitter):
    """A fitter whose bodies have measurements that are linear in the parameters."""

    names = ("stature", "weightkg", "waistcircumference")

    def __init__(self, generator):
        self._generator = generator
        self._slopes_of_all = np.random.default_rng(2).standard_normal((7, 3)) * [0.5, 150.0, 1.5]

    def measure(self, parameters, given):
        return [1.7, 72.0, 0.9] + parameters @ self._slopes_of_all


def test_people_get_bodies_with_their_measurements(generator):
    rng = np.random.default_rng(3)
    tables = {}
    for sex in adult_people.SEXES:
        rows = people(80, LinearFitter.names, rng) * [1000.0, 10.0, 1000.0]
        tables[sex] = dict(zip(LinearFitter.names, rows.T, strict=True))
    adults = LinearFitter(generator).fit(tables, seed=4, n_people=60)
    assert 110 < len(adults.is_woman) <= 120
    assert 50 < adults.is_woman.sum() <= 60
    np.testing.assert_array_less(np.abs(adults.given[:, 0] - adults.is_woman), 0.15)
    for measured, wanted in zip(adults.measured.T, adults.wanted.T, strict=True):
        # Not 1: people are drawn at random, and moved no further than measurements are uncertain.
        assert np.corrcoef(measured, wanted)[0, 1] > 0.93
    # What the measurements leave open differs between people.
    assert adults.parameters.std(axis=0).min() > 0.05


def test_coefficients_are_standard_deviations_of_both_sexes_alike(monkeypatch):
    coarse = load_open_model("coarse")
    monkeypatch.setattr(build_open_model, "load_open_model", lambda _: coarse)
    monkeypatch.setattr(build_open_model, "N_BETAS", 6)
    rng = np.random.default_rng(5)
    is_woman = np.arange(90) < 30
    true = rng.standard_normal((90, 6)) * [3, 2, 1.5, 1, 0.7, 0.5]
    true[is_woman] += [1.0, -1.0, 1.0, 0.0, 0.0, 0.0]
    skins = coarse.template.vertices + np.einsum("vxb,nb->nvx", coarse.shapedirs[..., :6], true)
    share = build_open_model.balanced(is_woman)
    np.testing.assert_allclose([share[is_woman].sum(), share.sum()], [0.5, 1.0])
    model = build_open_model.build_full(skins.astype(np.float32), share)
    np.testing.assert_allclose(model.template.vertices, np.tensordot(share, skins, 1), atol=1e-6)
    adults = adult_people.Adults(*[None] * 2, is_woman, *[None] * 3, rng.uniform(0.5, 2.0, 90))
    records = build_open_model.statistics(model, skins.astype(np.float32), adults)
    # Both sexes together have mean zero and covariance one.
    women, men = (records[name] for name in adult_people.SEXES)
    means = np.array([women["mean"], men["mean"]])
    np.testing.assert_allclose(means.mean(axis=0), np.zeros(6), rtol=0, atol=1e-2)
    within = (29 / 30 * np.array(women["covariance"]) + 59 / 60 * np.array(men["covariance"])) / 2
    together = within + means.T @ means / 2
    np.testing.assert_allclose(together, np.eye(6), rtol=0, atol=2e-2)


def test_coarse_model_that_ships_comes_from_the_full_one():
    full, coarse = load_open_model("full"), load_open_model("coarse")
    model = build_open_model.build_coarse(full)
    np.testing.assert_array_equal(model.template.vertices, coarse.template.vertices)
    np.testing.assert_array_equal(model.faces, coarse.faces)
    np.testing.assert_array_equal(model.shapedirs, coarse.shapedirs)
    np.testing.assert_array_equal(model.weights, coarse.weights)
    np.testing.assert_array_equal(model.hand_directions, coarse.hand_directions)
    betas = np.random.default_rng(1).standard_normal((10, full.n_betas))
    gaps = np.linalg.norm(coarse.joints(betas) - full.joints(betas), axis=-1)
    assert gaps.max() < 0.02
