"""Lists of measurements on pages, and pictures with numbered lines."""

import pytest
from open_bodies import coarse_bodies

import riemhuman as rh
from riemhuman.plots.measurement_views import MOST_IN_GROUP, grouped, pictured

BODIES = coarse_bodies()
MEASUREMENTS = rh.measurements.Measurements(BODIES.model)
EVERY = MEASUREMENTS.definitions.measurements
ROW = "[...document.querySelectorAll('[data-row]')].find((row) => row.textContent.startsWith('%s'))"


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    page = tmp_path_factory.mktemp("pages") / "measured.html"
    rh.plots.view_measurements(MEASUREMENTS, BODIES[20], pose="as is").save(page)
    return page


def test_every_measurement_is_in_one_group():
    groups = grouped(EVERY)
    members = [k for group in groups for k in group.members]
    assert sorted(members) == list(range(len(EVERY)))
    names = {group.title: [EVERY[k].name for k in group.members] for group in groups}
    assert "waist girth" in names["Girths"]
    assert "stature" in names["Heights"]
    lines = MEASUREMENTS.lines(BODIES[20])
    groups = pictured(EVERY, lines)  # those with lines
    drawn = [k for k, measurement in enumerate(EVERY) if lines[measurement.name]]
    assert sorted(k for group in groups for k in group.members) == drawn
    assert max(len(group.members) for group in groups) <= MOST_IN_GROUP


def test_numbers_of_a_picture_are_those_of_its_table():
    few = rh.measurements.Measurements(BODIES.model, ["waist girth", "hip girth", "stature"])

    def plot(**options):
        return rh.plots.plot_measurements(few, BODIES[20], pose="as is", height=80, **options)

    figure = plot(names={"hip girth": "Natural hips"})
    texts = {ax.get_title(): [text.get_text() for text in ax.texts] for ax in figure.axes[:2]}
    assert texts == {"Girths": ["1", "2"], "Heights": ["1"]}
    values = few.measure(BODIES[20], axes="space")
    table = [text.get_text() for text in figure.axes[2].texts]
    assert table[:3] == ["1", "waist girth", f"{100 * float(values['waist girth']):.1f} cm"]
    names = [text.get_text() for text in figure.axes[2].texts if text.get_ha() == "left"]
    assert names == ["waist girth", "Natural hips"]
    heights = BODIES[20][:, 1]
    above = heights > heights.mean() - 0.3  # without the feet, there is no stature
    seen = plot(trusted_vertices=above, system="in")
    assert [ax.get_title() for ax in seen.axes[:1]] == ["Girths"]
    assert len(seen.axes) == 2
    assert seen.axes[1].texts[2].get_text().endswith(" in")


@pytest.mark.slow
def test_rows_and_lines_light_each_other(browser, page):
    browser.open_viewer(page, 1000, 700)
    row = ROW % "hip girth"
    number = browser.run(f"return {row}.dataset.row")
    browser.run(f"{row}.dispatchEvent(new PointerEvent('pointerenter'))")
    lit = "return document.querySelector('[data-part=measurements]').dataset.lit"
    assert browser.run(lit) == number
    # Where the middle of the front of its line is in the stage.
    x, y = browser.run(
        """
        const { viewer } = document.querySelector('.viewer');
        const { panel, camera, stage } = viewer;
        const [body] = panel.bodies;
        const points = [];
        const [line] = panel.drawn[0].local[arguments[0]];
        for (let i = 0; i < line.length; i += 3) {
          points.push(new THREE.Vector3().fromArray(line, i).applyMatrix4(body.mesh.matrixWorld));
        }
        const nearest = points.reduce((a, b) => (b.z > a.z ? b : a)).project(camera);
        return [(nearest.x * stage.clientWidth) / 2, (-nearest.y * stage.clientHeight) / 2];
    """,
        int(number),
    )
    browser.run(f"{row}.dispatchEvent(new PointerEvent('pointerleave'))")
    assert browser.run(lit) == ""
    canvas = browser.find("canvas")
    browser.actions().move_to_element_with_offset(canvas, round(x), round(y)).perform()
    assert browser.run(lit) == number
    assert browser.run(f"return {row}.classList.contains('lit')")
    hint = browser.run("return document.querySelector('[data-part=hint]').textContent")
    assert hint.startswith("hip girth: ")
    assert browser.console() == []


@pytest.mark.slow
def test_measurements_are_found_by_name(browser, page):
    browser.open_viewer(page, 390, 800, dark=True)
    browser.run("""
        const find = document.querySelector('[data-measure=find]');
        find.value = 'Knee';
        find.dispatchEvent(new Event('input'));
    """)
    names = browser.run(
        "return [...document.querySelectorAll('[data-row]')].filter((row) => row.checkVisibility())"
        ".map((row) => row.querySelector('th').textContent)"
    )
    assert set(names) == {measurement.name for measurement in EVERY if "knee" in measurement.name}
    assert browser.run("return document.documentElement.scrollWidth") <= 390
    assert browser.console() == []
