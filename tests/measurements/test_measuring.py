"""Measurements of bodies: scaling, rigid motions, remeshing, gradients, poses, missing values."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from open_bodies import coarse_bodies
from scipy.spatial.transform import Rotation

from riemhuman.bodies import joint_motions, rotation_matrix, skin_surface
from riemhuman.datasets import load_open_bodies, load_open_model
from riemhuman.errors import ArgumentError, ArgumentTypeError, DegenerateSurfaceError
from riemhuman.measurements import Girth, Measurements, in_standard_pose
from riemhuman.measurements._vertex_slopes import slopes_along
from riemhuman.measurements.measuring import values_and_slopes
from riemhuman.surfaces import Template

DIMENSIONS = {"m": 1, "m²": 2, "m³": 3, "kg": 3}
LARGE = ["chest girth", "waist girth", "hip girth"]
LENGTHS = ["stature", "arm length", "inside leg height", "back length", "foot length"]


@pytest.fixture(scope="module")
def values(bodies, measurements):
    return measurements.measure(bodies.points[:20:3]).values


def test_rigid_motions_and_scaling(bodies, measurements, values):
    rotations = Rotation.random(7, random_state=1).as_matrix()
    moved = bodies.points[:20:3] @ rotations + np.array([3.0, -2.0, 1.0])
    np.testing.assert_allclose(measurements.measure(moved).values, values, rtol=1e-9)
    powers = np.array([DIMENSIONS[unit] for unit in measurements.units])
    scaled = measurements.measure(0.9 * bodies.points[:20:3]).values
    np.testing.assert_allclose(scaled, 0.9**powers * values, rtol=1e-9)


def test_all_in_one_pass_as_one_by_one(bodies, measurements, values):
    one_by_one = [measurements.measure(point).values for point in bodies.points[:20:3]]
    np.testing.assert_allclose(values, one_by_one, rtol=1e-12)
    stacked = measurements.measure(bodies.points[:4].reshape(2, 2, -1, 3))
    assert stacked.values.shape == (2, 2, len(measurements.names))
    assert stacked["stature"].shape == (2, 2)
    by_name = measurements.measure(bodies.points[:2]).to_dict()
    assert by_name["volume"][1] == measurements.measure(bodies.points[1])["volume"]


def test_derivatives(bodies, measurements):
    rng = np.random.default_rng(4)
    point = bodies.points[3]
    measured = measurements.measure(point, gradient=True)
    assert measured.gradient.shape == (len(measurements.names), *point.shape)
    direction = rng.normal(size=point.shape)
    slopes = np.sum(measured.gradient * direction, axis=(-2, -1))
    moved = measurements.measure(point + np.array([1e-6, -1e-6])[:, None, None] * direction).values
    np.testing.assert_allclose((moved[0] - moved[1]) / 2e-6, slopes, rtol=1e-3, atol=1e-3)


@dataclass(frozen=True, kw_only=True)
class Radius(Girth):
    """A girth over 2 π."""

    def value(self, bodies):
        return super().value(bodies) / (2.0 * np.pi)


def test_derivatives_of_a_value_of_ones_own_are_traced(bodies, measurements):
    waist = measurements.definitions.measurements[measurements.names.index("waist girth")]
    fields = {name: getattr(waist, name) for name in ("at", "normal", "parts", "leave_out", "hull")}
    both = Measurements(measurements.definitions, [waist, Radius(name="radius", **fields)])
    girth, radius = both.measure(bodies.points[3], gradient=True).gradient
    np.testing.assert_allclose(2.0 * np.pi * radius, girth, atol=1e-12)


def test_derivatives_along_directions(bodies, measurements):
    rng = np.random.default_rng(0)
    directions = rng.standard_normal((bodies.points[0].size, 4))
    values, slopes = values_and_slopes(measurements.definitions, bodies.points[[3]], "body")
    measured = measurements.measure(bodies.points[3], gradient=True)
    np.testing.assert_array_equal(values[0], measured.values)
    expected = measured.gradient.reshape(len(measurements.names), -1) @ directions
    np.testing.assert_allclose(slopes_along(slopes, directions), expected, rtol=1e-9, atol=1e-9)


def test_thigh_is_measured_where_the_line_crosses_the_trunk(measurements):
    """A crotch that is eight centimetres lower takes the place of a part of the line."""
    model = load_open_model("coarse")
    point = model(np.zeros(32), measurements.definitions.standard_pose_vector)
    crotch = measurements.definitions.landmarks["crotch"]
    middle = crotch[1] @ point[crotch[0]]
    lowered = point - 0.08 * np.exp(-(((point - middle) / 0.06) ** 2).sum(1))[:, None] * [0, 1, 0]
    thigh = measurements.definitions.measurements[measurements.names.index("thigh girth")]
    plain = Measurements(measurements.definitions, [replace(thigh, leave_out=())])
    assert list(plain.measure(lowered, missing="nan").why_missing) == [(0, "thigh girth")]
    girths = measurements.measure(np.stack([point, lowered]))["thigh girth"]
    np.testing.assert_allclose(girths[1], girths[0], rtol=0.1)


def test_navel_among_the_hips(measurements):
    """A person on whom the level of the navel meets the legs; nothing was tuned on them."""
    wide = load_open_bodies("coarse", "natural", people=1).points[80]
    waist = Measurements(measurements.definitions, ["waist girth (omphalion)", "hip girth"])
    values = waist.measure(wide, pose="standard").values
    assert 0.8 < values[0] / values[1] < 1.1


def test_lines_have_the_measured_lengths(bodies, measurements):
    lines, measured = measurements.lines(bodies.points[0]), measurements.measure(bodies.points[0])
    for name in measurements.names:
        if name in ("volume", "surface area", "body mass"):
            assert lines[name] == []
            continue
        length = sum(np.linalg.norm(np.diff(c, axis=0), axis=1).sum() for c in lines[name])
        np.testing.assert_allclose(length, measured[name], rtol=1e-9, err_msg=name)


def test_spread_over_poses():
    """One person in three poses measures alike in the standard pose; three people not tuned on."""
    bodies = load_open_bodies("coarse", people=7)
    measurements = Measurements(bodies.model, LARGE + LENGTHS)
    points = bodies.points[:60].reshape(6, 10, -1, 3)[::2, 1::3]
    standard = measurements.measure(points, pose="standard").values.std(axis=1, ddof=1)
    as_is = np.nanstd(measurements.measure(points, missing="nan").values, axis=1, ddof=1)
    n = len(LARGE)
    assert (np.median(standard[:, :n], axis=0) < 0.005).all()
    assert (np.median(standard[:, n:], axis=0) < 0.003).all()
    assert standard.max() < 0.008
    # As they stand, the hips of one person differ by centimetres between poses.
    assert np.median(as_is[:, LARGE.index("hip girth")]) > 0.05


def test_flesh_that_bulges_where_a_joint_bends_belongs_to_the_pose(measurements):
    """In the standard pose, an arm that bulges where the elbow bends keeps half of its bulge."""
    model, pose = load_open_model("coarse"), measurements.definitions.standard_pose_vector
    betas, elbow = np.zeros(32), model.joint_names.index("right_elbow")
    joints = model.joints(betas)
    offsets = (model.template.vertices - joints[elbow] - [-0.02, 0.02, 0.0]) / 0.08
    bulge = 0.04 * np.exp(-0.5 * np.sum(offsets**2, axis=1))[:, None] * offsets
    poses = coarse_bodies().pose_vectors[:10:2]
    bent = 1.0 - np.cos(np.linalg.norm(poses[:, elbow], axis=-1))

    def posed(poses):
        rest = model(betas) + bent[:, None, None] * bulge
        rotations = rotation_matrix(poses)
        motions = joint_motions(joints, rotations, model.parents)
        return skin_surface(rest, model.weights, joints, *motions)

    arm = Measurements(measurements.definitions, ["upper arm girth", "forearm girth"])
    bulging = arm.measure(posed(np.tile(pose, (5, 1, 1))), axes="space").values
    found = arm.measure(posed(poses), pose="standard").values
    assert (np.ptp(bulging, axis=0) > 0.005).all()
    assert (np.ptp(found, axis=0) < 0.5 * np.ptp(bulging, axis=0)).all()
    hardly_bent = [0, 1, 3, 4]
    np.testing.assert_allclose(found[hardly_bent], bulging[hardly_bent], rtol=0.01)


def test_bodies_of_the_model_come_back_to_the_standard_pose(bodies, measurements):
    model, rng = bodies.model, np.random.default_rng(0)
    betas = rng.normal(size=(2, 32))
    posed = model(betas, bodies.pose_vectors[[3, 9]], rng.normal(size=(2, 3)))
    straight = in_standard_pose(measurements.definitions, posed)
    expected = model(betas, measurements.definitions.standard_pose_vector)
    np.testing.assert_allclose(straight, expected, atol=2e-5)


def test_upright_people_keep_their_backs(measurements):
    """Bends of a spine that make up for each other are the shape of a back, not a pose."""
    model, pose = load_open_model("coarse"), measurements.definitions.standard_pose_vector.copy()
    spine = [model.joint_names.index(f"{part}_spine") for part in ("lower", "middle", "upper")]
    pose[[0, *spine, 4], 0] = np.radians([-11.0, 20.0, 12.0, -22.0, -10.0])
    hips = [model.joint_names.index(f"{side}_hip") for side in ("left", "right")]
    pose[hips, 0] += np.radians(11.0)
    waist = Measurements(
        measurements.definitions, [*LARGE, "waist height", "stature", "back length"]
    )
    upright = model(np.zeros(32), pose)
    straight = waist.measure(upright, pose="standard").values
    np.testing.assert_allclose(straight, waist.measure(upright, axes="space").values, atol=0.005)
    bent = waist.measure(
        model(np.zeros(32), measurements.definitions.standard_pose_vector), axes="space"
    )
    assert np.abs(straight - bent.values).max() > 0.02


def test_fists_measure_as_relaxed_hands(bodies, measurements):
    model = bodies.model
    which = np.array([0, 13, 27])
    shapes = bodies.betas[which], bodies.pose_vectors[which], bodies.translations[which]
    fists = model(*shapes, hands=np.tile(model.hand_pose("fist"), (3, 1)))
    relaxed, found = (measurements.measure(f, pose="standard") for f in (model(*shapes), fists))
    for name in ("hand length", "arm span"):
        assert np.abs(found[name] - relaxed[name]).max() < 0.008
    for name in ("wrist girth", "forearm girth", "forearm length", "arm length"):
        assert np.abs(found[name] - relaxed[name]).max() < 0.0005


def test_reflected_and_flat_bodies_are_refused(bodies, measurements):
    for wrong in (bodies.points[0] * [-1, 1, 1], 0.0 * bodies.points[0]):
        for pose in ("as is", "standard"):
            with pytest.raises(DegenerateSurfaceError, match="encloses"):
                measurements.measure(wrong, pose=pose)


def test_wrong_arguments(bodies, measurements):
    point = bodies.points[0]
    other = Template(point, bodies.template.faces[:-1])
    for wrong, message in (
        (lambda: measurements.measure(1000.0 * point), "a body in millimetres"),
        (lambda: Measurements(bodies.model, ["waist grith"]), "did you mean 'waist girth'"),
        (
            lambda: Measurements(measurements.definitions, [Girth(name="g", at="nose tip")]),
            "'nose tip'",
        ),
        (
            lambda: measurements.measure(point, pose="standard", gradient=True),
            "gradient requires pose",
        ),
        (lambda: Measurements(other), "there are no measurements for"),
        (lambda: measurements.measure(point)["statur"], "did you mean 'stature'"),
        (lambda: Measurements(bodies.model, measurements.definitions), "pass that as model"),
    ):
        with pytest.raises((ArgumentError, ArgumentTypeError), match=message):
            wrong()


def test_unseen_parts_are_not_measured(bodies, measurements):
    """A body whose legs no scan shows."""
    straight = bodies.model(bodies.betas[0], measurements.definitions.standard_pose_vector)
    trusted = straight[:, 1] > 0.9
    options = {"axes": "space", "missing": "nan"}
    measured = measurements.measure(straight, trusted_vertices=trusted, **options)
    plain = measurements.measure(straight, **options)
    for name in ("chest girth", "waist girth", "head girth", "arm length"):
        assert measured[name] == plain[name]
    for name in ("calf girth", "stature", "inside leg height", "volume", "thigh girth"):
        assert np.isnan(measured[name])
        assert "untrusted parts" in measured.why_missing[0, name]
    with pytest.raises(ArgumentError, match="untrusted parts"):
        measurements.measure(straight, trusted_vertices=trusted)
    # Fingers that may be closed thicken the knuckles, which they do not touch.
    tips, _ = measurements.definitions.landmarks["right_dactylion"]
    trusted = np.linalg.norm(straight - straight[tips[0]], axis=1) > 0.01
    measured = measurements.measure(straight, trusted_vertices=trusted, **options)
    assert measured.why_missing[0, "hand girth"] == "untrusted fingers may be bent"
    assert np.isfinite([measured["hand breadth"], measured["wrist girth"]]).all()


def test_sizes_are_a_mapping_of_names(bodies, measurements):
    sizes = measurements.measure(bodies.points[:2])
    assert list(sizes) == list(sizes.names)
    np.testing.assert_array_equal({**sizes}["volume"], sizes["volume"])
    assert sizes.get("statur", 2.0) == 2.0


def test_a_table_of_pandas(bodies, measurements):
    sizes = measurements.measure(bodies.points[:2])
    table = sizes.to_frame(bodies.ids[:2])
    assert table.loc["1", "stature"] == sizes["stature"][1]
    assert sizes.to_frame().shape == (2, len(measurements.names))
    with pytest.raises(
        ArgumentError, match="names must hold one name for each of the 2 bodies; found 1"
    ):
        sizes.to_frame(["anna"])
