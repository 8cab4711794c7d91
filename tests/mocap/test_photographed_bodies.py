"""Bodies of photographs, in stand-in files made of open bodies."""

import numpy as np
import pytest

import riemhuman as rh

TURNED = np.array([1.0, -1.0, -1.0])


@pytest.fixture
def photograph(bodies, tmp_path):
    """Return a function that writes a file in the layout of SAM 3D Body."""

    def write(points, name="photograph_1.npz"):
        arrays = {"pred_vertices": points.astype(np.float32), "pred_cam_t": np.ones(3)}
        rh.io.save_arrays(tmp_path / name, arrays)
        return tmp_path / name

    return write


def test_bodies_are_turned_upright(bodies, photograph, tmp_path):
    for number in range(2):
        photograph(bodies[number] * TURNED, f"photograph_{number}.npz")
    found = rh.datasets.load_photographed_bodies(tmp_path, bodies.template.faces)
    assert found.names == ("photograph_0", "photograph_1")
    np.testing.assert_allclose(found.points, bodies.points[:2], atol=1e-6)
    assert found.translations.shape == (2, 3)
    # In front of a camera whose y points down.
    np.testing.assert_allclose(found.places, found.points + TURNED)


def test_faces_come_from_a_mesh(bodies, photograph, tmp_path):
    rh.save_mesh(tmp_path / "mask.ply", 100.0 * bodies[5], bodies.template.faces)
    found = rh.datasets.load_photographed_bodies(
        photograph(bodies[0] * TURNED), tmp_path / "mask.ply"
    )
    np.testing.assert_array_equal(found.faces, bodies.template.faces)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda body: body[:-1] * TURNED, "1,202 vertices"),
        (lambda body: 100.0 * body * TURNED, "size|tall|long|metres"),
        (lambda body: body * [-1.0, -1.0, -1.0], "mirrored"),
        (lambda body: np.where(np.arange(1202)[:, None] == 7, np.nan, body * TURNED), "NaN"),
    ],
    ids=["vertices", "centimetres", "mirrored", "NaN"],
)
def test_other_bodies_are_refused_by_file(bodies, photograph, change, said):
    path = photograph(change(bodies[0]))
    with pytest.raises(rh.RiemhumanError, match=f"photograph_1.*({said})"):
        rh.datasets.load_photographed_bodies(path, bodies.template.faces)


def test_recordings_say_which_reader_reads_them(bodies, photograph):
    with pytest.raises(rh.errors.FileFormatError, match="load_photographed_bodies"):
        rh.datasets.load_recording(photograph(bodies[0] * TURNED))


def test_people_who_lie_are_y_down_unless_told(bodies, photograph):
    lying = bodies[0][:, [1, 2, 0]]
    path = photograph(lying)
    with pytest.warns(UserWarning, match="may be lying"):
        found = rh.datasets.load_photographed_bodies(path, bodies.template.faces)
    assert found.up == "-y"
    found = rh.datasets.load_photographed_bodies(path, bodies.template.faces, up="x")
    np.testing.assert_allclose(np.ptp(found.points[0, :, 1]), np.ptp(bodies[0][:, 1]), rtol=1e-5)


def test_frames_of_one_person_have_one_shape(bodies, photograph):
    model, rng = bodies.model, np.random.default_rng(49)
    motion = rh.datasets.load_open_motions("coarse", sequences=["knees"])[0]
    frames = motion.pose_vectors[:40:10]
    betas = motion.betas + 0.3 * rng.standard_normal((len(frames), model.n_betas))
    seen = np.stack([model(shape, pose) for shape, pose in zip(betas, frames, strict=True)])
    path = photograph(seen * TURNED)
    with pytest.warns(UserWarning, match="differ between frames"):
        found = rh.datasets.load_recording(path, model, faces=model.faces, frames_per_second=10)
    assert len(found) == len(frames)
    assert found.frames_per_second == 10
    np.testing.assert_allclose(found.betas[:3], betas[:, :3].mean(axis=0), atol=0.05)
    exact = np.stack([model(betas.mean(axis=0), pose) for pose in frames])
    moved = [rh.procrustes(body, to=to) for body, to in zip(found, exact, strict=True)]
    assert np.linalg.norm(moved - exact, axis=-1).mean() < 0.005


def test_motions_need_a_model_of_the_triangles(bodies, photograph):
    path = photograph(bodies[:2] * TURNED)
    for model in (None, rh.datasets.load_open_model("full")):
        with pytest.raises(rh.errors.FileFormatError, match="photograph_1.*transfer_model"):
            rh.datasets.load_recording(path, model, faces=bodies.template.faces)
