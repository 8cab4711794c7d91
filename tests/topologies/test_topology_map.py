"""Maps to a second topology: remeshed, of other density, in another rest pose, fingers apart."""

from types import SimpleNamespace

import numpy as np
import pytest
from open_bodies import model_with
from scanned_people import points_at
from scipy.spatial import cKDTree

import riemhuman as rh
from riemhuman.registration import ScanRegistration
from riemhuman.registration.simulated_scans import remesh
from riemhuman.topologies import TopologyMap, _vertex_places

ArgumentError, FileFormatError = rh.errors.ArgumentError, rh.errors.FileFormatError


def made_from(map_points, faces, registered, model, monkeypatch):
    """Return a map from a body whose registration is known."""
    known = SimpleNamespace(points=registered, fit=None, trusted=True, message="")
    monkeypatch.setattr(ScanRegistration, "solve", lambda *options: known)
    return TopologyMap.fit(map_points, model, faces=faces)


def bodies_of(model, resolution, n_vertices):
    """Return bodies of a model and of another topology, the first in its rest pose.

    They come with the triangles of the topology.
    """
    rng = np.random.default_rng(49)
    rest = np.zeros((model.n_joints, 3))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        rest[model.joint_names.index(f"{side}_shoulder")] = [0.0, 0.0, 0.5 * sign]
        rest[model.joint_names.index(f"{side}_hip")] = [0.0, 0.0, 0.1 * sign]
    bodies = [model(np.zeros(model.n_betas), rest, hands=model.hand_pose("open"))]
    vertices, faces = remesh(bodies[0], model.faces, n_vertices, rng)
    places, _ = rh.surfaces.nearest_points(vertices, bodies[0], model.faces)
    motions = rh.datasets.load_open_motions(resolution, sequences=["punching", "knees"])
    for motion, frame, hands in zip(motions, (47, 61), ("relaxed", "curled"), strict=False):
        betas = np.zeros(model.n_betas)
        betas[:10] = rng.standard_normal(10)
        bodies.append(model(betas, motion.pose_vectors[frame], hands=model.hand_pose(hands)))
    others = np.stack([points_at(places, body, model.faces) for body in bodies])
    return np.stack(bodies), others, faces


@pytest.fixture(scope="module")
def small(model):
    """Return a coarse model that is not the open one, which needs no finer registration."""
    return model_with(model, v_template=model.template.vertices + 1e-9)


@pytest.fixture(scope="module")
def people(small):
    return bodies_of(small, "coarse", 2000)


@pytest.fixture(scope="module")
def known(people, small):
    """Return the map from one body whose registration is known."""
    bodies, others, faces = people
    with pytest.MonkeyPatch.context() as patch:
        return made_from(others[0], faces, bodies[0], small, patch)


@pytest.fixture(scope="module")
def full():
    return rh.datasets.load_open_model("full")


@pytest.fixture(scope="module")
def full_people(full):
    return bodies_of(full, "full", 6890)


@pytest.fixture(scope="module")
def registered(full_people, full):
    """Return the map from one body, registered as any other."""
    _, others, faces = full_people
    return TopologyMap.fit((others[0], faces), full)


def on_hands(model):
    return np.isin(
        model.weights.argmax(axis=1),
        [model.joint_names.index(f"{side}_wrist") for side in ("left", "right")],
    )


@pytest.mark.parametrize("name", ["known", pytest.param("registered", marks=pytest.mark.slow)])
def test_other_people_in_other_poses_come_to_their_places(name, request):
    found = request.getfixturevalue(name)
    names = {"known": "people", "registered": "full_people"}
    bodies, others, _ = request.getfixturevalue(names[name])
    errors = np.linalg.norm(found.to_model(others) - bodies, axis=-1)[1:]
    assert errors.mean() < 0.003
    assert errors[:, on_hands(found.model)].mean() < 0.006
    errors = np.linalg.norm(found.to_template(bodies) - others, axis=-1)[1:]
    assert errors.mean() < 0.003


def test_there_and_back_is_the_same_body(known, people):
    _, others, *_ = people
    back = known.to_template(known.to_model(others))
    assert np.linalg.norm(back - others, axis=-1).mean() < 0.001


def test_people_are_as_far_apart_over_both_topologies(known, people):
    bodies, others, faces = people
    space, other_space = (
        rh.AlignedSurfaces(rh.Template(surfaces[0], triangles))
        for surfaces, triangles in ((bodies, known.model.faces), (others, faces))
    )
    expected = rh.PersonMetric(space).dist_pairwise(bodies)
    found = rh.PersonMetric(other_space, known).dist_pairwise(others)
    np.testing.assert_allclose(found, expected, rtol=0.25)
    areas = rh.AreaMetric(other_space).dist_pairwise(others)
    assert np.all(found[found > 0] < 0.9 * areas[found > 0])
    with pytest.raises(ArgumentError, match="topology must be a map of the triangles of space"):
        rh.PersonMetric(space, known)


def test_files_hold_the_map(known, people, model, tmp_path):
    _, others, _ = people
    known.save(tmp_path / "map.npz")
    assert (tmp_path / "map.npz").stat().st_size < 1.5e6
    again = TopologyMap.load(tmp_path / "map.npz")
    assert again.model is model
    bodies = known.to_model(others[1])
    np.testing.assert_allclose(again.to_model(others[1]), bodies, atol=1e-7)
    np.testing.assert_allclose(again.to_template(bodies), known.to_template(bodies), atol=1e-7)
    with pytest.raises(FileFormatError, match="is for a model with 1,202 vertices"):
        TopologyMap.load(tmp_path / "map.npz", rh.datasets.load_open_model("full"))
    arrays = rh.io.load_arrays(tmp_path / "map.npz", ())
    arrays["to_model_columns"] = arrays["to_model_columns"] + 1_000_000
    rh.io.save_arrays(tmp_path / "wrong.npz", arrays)
    with pytest.raises(FileFormatError, match="to_model_columns must hold whole numbers from 0"):
        TopologyMap.load(tmp_path / "wrong.npz")


def test_bad_bodies_are_refused_by_name(known, people, tmp_path):
    _, others, faces = people
    body = others[1]
    with pytest.raises(ArgumentError, match=f"must have {len(body):,} vertices.*found 10"):
        known.to_model(body[:10])
    with pytest.raises(ArgumentError, match="triangles of the map"):
        known.to_model((body, faces[::-1]))
    with pytest.raises(ArgumentError, match="points: .* body 1 .*mirrored"):
        known.to_model(np.stack([body, body * [-1.0, 1.0, 1.0]]))
    with pytest.raises(ArgumentError, match="times as large"):
        known.to_model(100.0 * body)
    with pytest.raises(ArgumentError, match='up="-y" turns the bodies upright'):
        known.to_model(body * [1.0, -1.0, -1.0])
    upright = known.to_model(body * [1.0, -1.0, -1.0], up="-y")
    np.testing.assert_allclose(upright[:, 1], known.to_model(body)[:, 1], atol=1e-9)
    frames = np.stack([body, body])
    frames[1, 7, 0] = np.nan
    with pytest.raises(ArgumentError, match=r"first at index \(1, 7, 0\)"):
        known.to_model(frames)
    rh.save_mesh(tmp_path / "large.ply", 100.0 * body, faces)
    with pytest.raises(FileFormatError, match=r"large\.ply is .* times as large"):
        known.to_model(tmp_path / "large.ply")
    with pytest.raises(ArgumentError, match="mirrored"):
        TopologyMap.fit((body * [-1.0, 1.0, 1.0], faces))


def unit_sphere():
    longitudes, latitudes = np.meshgrid(np.arange(12) * np.pi / 6, np.arange(1, 8) * np.pi / 8)
    ring = np.stack(
        [
            np.sin(latitudes) * np.cos(longitudes),
            np.cos(latitudes),
            np.sin(latitudes) * np.sin(longitudes),
        ],
        axis=-1,
    ).reshape(-1, 3)
    vertices = np.concatenate([ring, [[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]])
    faces = []
    for row in range(6):
        for k in range(12):
            a, b = 12 * row + k, 12 * row + (k + 1) % 12
            faces += [[a, b, b + 12], [a, b + 12, a + 12]]
    for k in range(12):
        faces += [[84, (k + 1) % 12, k], [85, 72 + k, 72 + (k + 1) % 12]]
    return vertices, np.array(faces)


def test_registrations_that_are_not_trusted_are_refused_by_name(people, monkeypatch, tmp_path):
    _, others, faces = people
    doubtful = SimpleNamespace(trusted=False, message="an arm may be elsewhere")
    monkeypatch.setattr(ScanRegistration, "solve", lambda *options: doubtful)
    rh.save_mesh(tmp_path / "odd.ply", others[0], faces)
    with pytest.raises(FileFormatError, match=r"odd\.ply must be a body .*an arm may be elsewhere"):
        TopologyMap.fit(tmp_path / "odd.ply")
    with pytest.raises(ArgumentError, match="^template must be a body .*an arm"):
        TopologyMap.fit((others[0], faces))


def with_eyeballs(body, faces, head):
    """Return a mesh with two spheres in its head, one the mirror image of the other."""
    ball, triangles = unit_sphere()
    mirrored, count = ball * [-1.0, 1.0, 1.0], len(body)
    shift = np.array([0.03, 0.0, 0.0])
    vertices = [body, head + 0.012 * ball + shift, head + 0.012 * mirrored - shift]
    faces = [faces, triangles + count, triangles[:, ::-1] + count + len(ball)]
    return np.concatenate(vertices), np.concatenate(faces)


@pytest.mark.slow
def test_maps_between_symmetric_meshes_treat_both_sides_alike(full, monkeypatch):
    """The open model's own mesh with eyeballs, turned unevenly, and an uneven registration."""
    rest, mirror = full.template.vertices, np.array([-1.0, 1.0, 1.0])
    opposite = cKDTree(rest).query(rest * mirror)[1]
    motion = rh.datasets.load_open_motions("full", sequences=["punching"])[0]
    pose = np.zeros((full.n_joints, 3))
    pose[full.joint_names.index("left_shoulder")] = [0.2, 0.0, 0.5]
    body, slip = full(pose=pose), 0.002 * np.sin(40.0 * rest + 1.0)
    head = full.joints()[full.joint_names.index("head")] + [0.0, 0.09, 0.05]
    surface, faces = with_eyeballs(body, full.faces, head)
    found = made_from(surface, faces, body + slip, full, monkeypatch)
    assert {*found.template_parts} >= {"left eyeball", "right eyeball"}
    betas = np.random.default_rng(0).standard_normal(full.n_betas)
    person = full(betas, motion.pose_vectors[47])
    other = found.to_template(person)
    skin, back = other[: len(rest)], found.to_model(other)
    mirrored = found.to_template(person[opposite] * mirror)
    gaps = np.linalg.norm(mirrored[: len(rest)] - skin[opposite] * mirror, axis=1)
    assert gaps.mean() < 1e-4  # of 2.4 mm without an average over both sides
    gaps = np.linalg.norm(found.to_model(mirrored) - back[opposite] * mirror, axis=1)
    assert gaps.mean() < 1e-4
    assert np.linalg.norm(back - person, axis=1).mean() < 0.0005
    errors = np.linalg.norm(skin - person, axis=1)
    assert errors.mean() < np.linalg.norm(slip, axis=1).mean()


def test_small_parts_that_are_mostly_apart_have_no_counterpart():
    ball, triangles = unit_sphere()
    points = np.concatenate([ball, 0.05 * ball + [2.0, 0.0, 0.0]])
    is_small = np.arange(len(points)) >= len(ball)
    gaps = np.where(is_small & (np.arange(len(points)) % 2 == 0), 0.1, 0.0)
    faces = np.concatenate([triangles, triangles + len(ball)])
    without = _vertex_places.find_without_counterpart(points, faces, gaps)
    np.testing.assert_array_equal(without, is_small)


@pytest.fixture(scope="module")
def to_coarse(full_people, full):
    """Return the map to the coarse model, from a body whose registration is known."""
    bodies, others, faces = full_people
    with pytest.MonkeyPatch.context() as patch:
        return made_from(others[0], faces, bodies[0], rh.datasets.load_open_model("coarse"), patch)


class Stopped(Exception):
    """Raised in place of a registration."""


@pytest.mark.parametrize("up", ["-x", "-y", "z"])
def test_bodies_in_any_axes_are_registered_upright(model, monkeypatch, up):
    """What registration gets is the body y up: a map has no way to depend on the axes of a file."""
    body, seen = model(), []

    def register(registration, scan):
        points, _ = scan  # with further ones in the middle of edges
        seen.append(points[: len(body)])
        raise Stopped

    monkeypatch.setattr(ScanRegistration, "solve", register)
    axis, sign = "xyz".index(up[-1]), -1.0 if up.startswith("-") else 1.0
    turned = np.roll(body, axis - 1, axis=1) if axis != 1 else body * [1, -1, -1]
    if axis != 1 and sign < 0:
        turned = turned * np.where(np.arange(3) == (axis + 1) % 3, -1.0, 1.0)
        turned[:, axis] *= -1.0
    for options in ({}, {"up": up}):
        with pytest.raises(Stopped):
            TopologyMap.fit((turned, model.faces), **options)
        np.testing.assert_allclose(seen[-1][:, 1], body[:, 1], atol=1e-12)
    if up == "-y":
        np.testing.assert_allclose(seen[0], body, atol=1e-12)


@pytest.mark.slow
def test_frames_of_a_person_become_a_motion(to_coarse, full, tmp_path):
    coarse = to_coarse.model
    performed = rh.datasets.load_open_motions("coarse", sequences=["knees"])[0]
    poses, betas = performed.pose_vectors[20:24], np.linspace(-1.0, 1.0, coarse.n_betas)
    shift = np.array([0.3, 0.0, 0.1])
    frames = to_coarse.to_template(np.stack([coarse(betas, pose, shift) for pose in poses]))
    seen = frames * [1, -1, -1]
    with pytest.warns(UserWarning, match="knees: betas differ between frames"):
        motion = to_coarse.to_motion(seen, 25.0, name="knees", up="-y")
    assert (len(motion), motion.frames_per_second) == (4, 25.0)
    assert np.linalg.norm(motion[:] - to_coarse.to_model(seen, up="-y"), axis=-1).mean() < 0.003
    motion.save(tmp_path / "knees.bvh")
    motion.save(tmp_path / "knees.npz")
    again = rh.datasets.load_recording(tmp_path / "knees.npz")
    np.testing.assert_allclose(again[:], motion[:], atol=1e-5)
    for wrong in (frames[0], frames[:0]):
        with pytest.raises(ArgumentError, match="n_frames, V, 3"):
            to_coarse.to_motion(wrong, 25.0)
