"""What pages store of a body: coordinates, colours of values, and what components change."""

import numpy as np
import pytest
from cases import sphere_template, surfaces
from page_data import inflated, unpacked

from riemhuman.plots import ViewedBody
from riemhuman.plots.viewed_bodies import ComponentChanges, body_record

TEMPLATE = sphere_template()
PATH = surfaces(TEMPLATE, 4)
AT_FIVE = (TEMPLATE.faces == 5).any(axis=1)


@pytest.mark.parametrize(
    ("frames", "most"),
    [(PATH, 1e-4), (PATH[:1], 1e-4), (0.01 * PATH, 1e-6)],
    ids=["path", "single", "small"],
)
def test_coordinates_are_restored_to_a_tenth_of_a_millimetre(frames, most):
    record = body_record(ViewedBody("one", frames), TEMPLATE.faces)
    assert (record["label"], record["n_frames"]) == ("one", len(frames))
    numbers = unpacked(record["frames"], np.uint16, PATH[0].size if len(frames) > 1 else 3)
    steps = np.array(record["step"])
    found = np.array(record["low"]) + steps * numbers.reshape(-1, *PATH[0].shape)
    assert steps.max() <= most  # metres
    assert np.abs(found - frames).max() <= 0.5001 * steps.max()


def test_values_become_colours_of_vertices():
    body = ViewedBody("one", PATH[:1], values=AT_FIVE.astype(float))
    colors = inflated(body_record(body, TEMPLATE.faces)["colors"], np.uint8).reshape(-1, 3)
    assert len(colors) == TEMPLATE.n_vertices
    assert colors[5].tolist() == [0x8C, 0x1D, 0x3F]
    far = np.ones(TEMPLATE.n_vertices, bool)
    far[TEMPLATE.faces[AT_FIVE]] = False
    assert (colors[far] == [0xD4, 0xC8, 0xBB]).all()


def test_negative_values_keep_their_sign():
    values = np.where(AT_FIVE, -2.0, 1.0)
    signed, plain = (
        body_record(ViewedBody("one", PATH[:1], values=shown), TEMPLATE.faces)
        for shown in (values, np.abs(values))
    )
    assert (signed["signed"], plain["signed"]) == (True, False)
    assert signed["scale"][-4:] == plain["scale"]
    red, _, blue = inflated(signed["colors"], np.uint8).reshape(-1, 3)[5].tolist()
    assert blue > red + 60
    red, _, blue = inflated(plain["colors"], np.uint8).reshape(-1, 3)[5].tolist()
    assert red > blue + 60


def test_bodies_may_share_the_value_of_the_last_colour():
    values = AT_FIVE.astype(float)
    body = ViewedBody("one", PATH[:1], values=values, value_limit=4.0)
    assert body_record(body, TEMPLATE.faces)["largest"] == body.limit == 4.0
    assert ViewedBody("none", PATH[:1]).limit == 0.0


def test_components_mix_linear_and_quadratic_changes():
    linear, quadratic = np.random.default_rng(2).uniform(-0.1, 0.1, (2, 2, *PATH[0].shape))
    changes = ComponentChanges(linear, quadratic, np.array([0.6, 0.2]))
    expected = PATH[0] + 1.5 * linear[0] - 2.0 * linear[1] + 2.25 * quadratic[0] + 4 * quadratic[1]
    np.testing.assert_allclose(changes.mixed(PATH[0], np.array([1.5, -2.0])), expected, atol=1e-14)
    body = ViewedBody("mean", PATH[:1], components=changes)
    records = body_record(body, TEMPLATE.faces)["components"]
    for record, *given in zip(records, linear, quadratic, strict=True):
        for name, change in zip(("linear", "quadratic"), given, strict=True):
            whole = unpacked(record[name]["changes"], np.uint16, 3).view(np.int16)
            step = record[name]["step"]
            assert np.abs(step * whole - change).max() <= 0.5001 * step


def test_times_count_where_frames_are_shown_more_than_once():
    body = ViewedBody("warped", PATH, times=np.array([0.0, 0.5, 1.25, 2.0, 3.0]))
    assert body.n_times == 5
    assert body_record(body, TEMPLATE.faces)["times"] == [0.0, 0.5, 1.25, 2.0, 3.0]
