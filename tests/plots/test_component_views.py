"""Pages with sliders of components: the page's bodies are those of Python."""

import numpy as np
import pytest
from cases import sphere_template, surfaces

from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.plots import view_components
from riemhuman.solvers import TangentPCA

TEMPLATE = sphere_template()
POSITIONS = """
const body = document.querySelector(".viewer").viewer.bodies()[0];
return [...body.positions].map((value, i) => value + body.centre[i % 3]);
"""


@pytest.fixture(scope="module")
def pca():
    points = surfaces(TEMPLATE, 4, size=0.1)
    space = AlignedSurfaces(TEMPLATE).equip_with_metric(ElasticMetric, a=1.0, lam=1.0, c=1.0)
    return TangentPCA(space, 3).fit(points)


def test_bodies_at_two_deviations_are_exact_and_those_between_near(pca):
    (body,) = view_components(pca).choices["Components"]
    deviations = np.sqrt(pca.explained_variance_)
    for scores in ([0, 0, 0], [2, 0, 0], [-2, 0, 0], [0, 0, 2]):
        found = body.components.mixed(body.frames[0], np.array(scores, dtype=float))
        (exact,) = pca.inverse_transform(scores * deviations[None])
        np.testing.assert_allclose(found, exact, atol=1e-12)
    (exact,) = pca.inverse_transform([1, 0, 0] * deviations[None])
    found = body.components.mixed(body.frames[0], np.array([1.0, 0.0, 0.0]))
    moved = np.abs(exact - body.frames[0]).max()
    assert np.abs(found - exact).max() < 0.05 * moved


@pytest.mark.slow
def test_sliders_mix_in_the_page_what_python_mixes(browser, pca, tmp_path):
    viewer = view_components(pca)
    viewer.save(tmp_path / "components.html")
    browser.open_viewer(tmp_path / "components.html", 1000, 760)
    (body,) = viewer.choices["Components"]
    middle = body.frames[0]

    def shown():
        return np.array(browser.run(POSITIONS)).reshape(-1, 3)

    def scores():
        found = browser.run(
            "return [...document.querySelectorAll('[data-part=components] input')]"
            ".map((e) => Number(e.value))"
        )
        return np.array(found)

    rows = browser.driver.find_elements("css selector", "[data-part=components] label")
    np.testing.assert_allclose(shown(), middle, atol=2e-4)
    slider = rows[1].find_element("css selector", "input")
    browser.run("arguments[0].focus()", slider)
    browser.press("\ue010")  # End
    assert scores().tolist() == [0, 3, 0]
    expected = body.components.mixed(middle, scores())
    assert np.abs(expected - middle).max() > 0.05
    np.testing.assert_allclose(shown(), expected, atol=2e-4)
    uniform = [0.5, 0.1, 0.2, 0.6, 0.999999, 0.0]
    browser.run("const given = arguments[0]; Math.random = () => given.shift();", uniform)
    browser.find("[data-action=sample]").click()
    drawn = scores()
    radii, turns = np.sqrt(-2 * np.log1p(-np.array(uniform[::2]))), uniform[1::2]
    normal = radii * np.cos(2 * np.pi * np.array(turns))  # Box and Muller
    np.testing.assert_allclose(drawn, normal.clip(-3, 3), atol=0.026)  # sliders have steps of 0.05
    assert drawn[2] == 3
    np.testing.assert_allclose(shown(), body.components.mixed(middle, drawn), atol=2e-4)
    browser.find("[data-action=middle]").click()
    assert scores().tolist() == [0, 0, 0]
    np.testing.assert_allclose(shown(), middle, atol=2e-4)
    assert browser.console() == []


def test_bad_arguments(pca):
    with pytest.raises(ArgumentTypeError, match=r"pca must be a TangentPCA\(\.\.\.\)"):
        view_components(np.zeros((3, 3)))
    with pytest.raises(ArgumentError, match="fitted first"):
        view_components(TangentPCA(pca.space))
    with pytest.raises(ArgumentError, match="faces"):
        view_components(pca, [[0, 1, 99]])
