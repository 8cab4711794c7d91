"""Measurements of bodies: scaling, rigid motions, remeshing, gradients, and what is refused."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from riemhuman.datasets import load_open_bodies, load_open_model
from riemhuman.errors import ArgumentError
from riemhuman.measurements import Girth, Measurements
from riemhuman.surfaces.template import Template

DIMENSIONS = {"m": 1, "m²": 2, "m³": 3, "kg": 3}


@pytest.fixture(scope="module")
def bodies():
    return load_open_bodies("coarse")


@pytest.fixture(scope="module")
def own(bodies):
    return Measurements(bodies.model)


@pytest.fixture(scope="module")
def values(bodies, own):
    return own.measure(bodies.points[:20:3]).values


def test_rigid_motions_change_nothing(bodies, own, values):
    turns = Rotation.random(7, random_state=1).as_matrix()
    moved = bodies.points[:20:3] @ turns + np.array([3.0, -2.0, 1.0])
    np.testing.assert_allclose(own.measure(moved).values, values, rtol=1e-9)


def test_scaling(bodies, own, values):
    powers = np.array([DIMENSIONS[unit] for unit in own.units])
    scaled = own.measure(0.9 * bodies.points[:20:3]).values
    np.testing.assert_allclose(scaled, 0.9**powers * values, rtol=1e-9)


def test_all_in_one_pass_as_one_by_one(bodies, own, values):
    one_by_one = [own.measure(point).values for point in bodies.points[:20:3]]
    np.testing.assert_allclose(values, one_by_one, rtol=1e-12)
    stacked = own.measure(bodies.points[:4].reshape(2, 2, -1, 3))
    assert stacked.values.shape == (2, 2, len(own.names))
    assert stacked["stature"].shape == (2, 2)


def test_remeshing_changes_little(own):
    """Both resolutions of the model show the same people."""
    rng = np.random.default_rng(0)
    betas = rng.normal(size=(4, 16))
    full = load_open_model("full")
    pose = own.definitions.standard_pose
    vectors = np.array([pose.get(name, np.zeros(3)) for name in full.joint_names])
    fine = Measurements(full).measure(full(betas, vectors))
    coarse = own.measure(load_open_model("coarse")(betas, vectors))
    gaps = np.abs(coarse.values - fine.values)[:, [unit == "m" for unit in own.units]]
    assert np.median(gaps) < 0.004
    assert gaps.max() < 0.03


def test_taylor_slopes_of_all(bodies, own):
    rng = np.random.default_rng(4)
    point = bodies.points[3]
    measured = own.measure(point, gradient=True)
    assert measured.gradient.shape == (len(own.names), *point.shape)
    direction = rng.normal(size=point.shape)
    slopes = np.sum(measured.gradient * direction, axis=(-2, -1))
    steps = np.array([1e-6, -1e-6])
    moved = own.measure(point + steps[:, None, None] * direction).values
    np.testing.assert_allclose((moved[0] - moved[1]) / 2e-6, slopes, rtol=1e-3, atol=1e-3)


def test_gradient_of_many_is_that_of_each(bodies, own):
    some = own.definitions.with_measurements(["waist girth", "volume", "back length"])
    own = Measurements(some)
    both = own.measure(bodies.points[:2], gradient=True).gradient
    each = [own.measure(point, gradient=True).gradient for point in bodies.points[:2]]
    np.testing.assert_allclose(both, each, atol=1e-12)


def test_volume_and_area_are_those_of_the_surface(bodies, own, values):
    mesh = bodies.template.to_trimesh(bodies.points[0])
    measured = own.measure(bodies.points[0])
    np.testing.assert_allclose(measured["volume"], mesh.volume, rtol=1e-9)
    np.testing.assert_allclose(measured["surface area"], mesh.area, rtol=1e-9)
    np.testing.assert_allclose(measured["body mass"], 1000.0 * mesh.volume, rtol=1e-9)


def test_sizes_of_people(own):
    """The mean adult has the size of adults, and grows with its shape."""
    measured = own.measure(load_open_model("coarse")())
    for name, low, high in (
        ("stature", 1.6, 1.85),
        ("head girth", 0.52, 0.6),
        ("neck girth", 0.3, 0.42),
        ("chest girth", 0.8, 1.05),
        ("waist girth", 0.65, 0.95),
        ("hip girth", 0.85, 1.1),
        ("thigh girth", 0.48, 0.65),
        ("calf girth", 0.3, 0.42),
        ("wrist girth", 0.13, 0.19),
        ("arm length", 0.48, 0.65),
        ("inside leg height", 0.7, 0.88),
        ("back length", 0.35, 0.48),
        ("foot length", 0.22, 0.29),
        ("surface area", 1.5, 2.1),
        ("body mass", 50, 85),
    ):
        assert low < measured[name] < high, name


def test_tables(bodies, own, values):
    pandas = pytest.importorskip("pandas")
    frame = own.measure(bodies.points[:2]).to_frame(["one", "other"])
    assert isinstance(frame, pandas.DataFrame)
    assert frame.loc["other", "volume (m³)"] == own.measure(bodies.points[1])["volume"]


def test_tapes_are_where_they_measure(bodies, own):
    tapes, measured = own.tapes(bodies.points[0]), own.measure(bodies.points[0])
    for name in own.names:
        if name in ("volume", "surface area", "body mass"):
            assert tapes[name] == []
            continue
        length = sum(np.linalg.norm(np.diff(c, axis=0), axis=1).sum() for c in tapes[name])
        np.testing.assert_allclose(length, measured[name], rtol=1e-9, err_msg=name)


def test_what_is_refused(bodies, own):
    point = bodies.points[0]
    with pytest.raises(ArgumentError, match="a body in millimetres"):
        own.measure(1000.0 * point)
    with pytest.raises(ArgumentError, match="did you mean 'waist girth'"):
        Measurements(bodies.model, ["waist grith"])
    with pytest.raises(ArgumentError, match="'nose tip'"):
        Measurements(bodies.model, [Girth(name="g", at="nose tip")])
    with pytest.raises(ArgumentError, match="shape"):
        own.measure(point[:-1])
    with pytest.raises(ArgumentError, match="pose must be one of"):
        own.measure(point, pose="t")
    with pytest.raises(ArgumentError, match="gradient requires pose"):
        own.measure(point, pose="standard", gradient=True)
    other = Template(point, bodies.template.faces[:-1])
    with pytest.raises(ArgumentError, match="there are no measurements for"):
        Measurements(other)
    with pytest.raises(ArgumentError, match="did you mean 'stature'"):
        own.measure(point)["statur"]
