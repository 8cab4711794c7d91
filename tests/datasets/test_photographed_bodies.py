"""Bodies of photographs, in stand-in files made of open bodies."""

import numpy as np
import pytest

import riemhuman as rh

TURNED = np.array([1.0, -1.0, -1.0])


@pytest.fixture(scope="module")
def bodies():
    return rh.datasets.load_open_bodies("coarse")


@pytest.fixture
def photograph(bodies, tmp_path):
    """Return a function that writes a file in the layout of SAM 3D Body."""

    def write(points, name="photograph_1.npz"):
        arrays = {"pred_vertices": points.astype(np.float32), "pred_cam_t": np.ones(3)}
        rh.io.save_arrays(tmp_path / name, arrays)
        return tmp_path / name

    return write


def test_bodies_are_turned_upright_and_say_what_is_missing(bodies, photograph, tmp_path):
    for number in range(2):
        photograph(bodies[number] * TURNED, f"photograph_{number}.npz")
    found = rh.datasets.load_photographed_bodies(tmp_path, bodies.template.faces)
    assert found.names == ("photograph_0", "photograph_1")
    np.testing.assert_allclose(found.points[..., 1], bodies.points[:2, :, 1], atol=1e-6)
    assert found.missing == ("pred_keypoints_3d", "shape_params")
    assert found.translations.shape == (2, 3)


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
