"""Facts about the open bodies, plain and natural."""

import numpy as np
import pytest

from riemhuman.datasets import load_open_bodies
from riemhuman.datasets.open_poses import read_table
from riemhuman.errors import ArgumentError


def test_ten_subjects_in_ten_poses(bodies):
    assert len(bodies) == 100
    np.testing.assert_array_equal(10 * bodies.subject + bodies.pose, np.arange(100))
    assert sorted(set(bodies.subject)) == sorted(set(bodies.pose)) == list(range(10))
    assert len(set(bodies.subject_names)) == len(set(bodies.pose_names)) == 10
    assert bodies.template is bodies.model.template
    betas = bodies.betas.reshape(10, 10, -1)
    np.testing.assert_array_equal(betas, np.repeat(betas[:, :1], 10, axis=1))
    assert np.abs(betas).max() < 3  # standard deviations
    gaps = np.linalg.norm(betas[:, None, 0] - betas[None, :, 0], axis=-1)
    assert gaps[~np.eye(10, dtype=bool)].min() > 2


def test_loading_again_gives_the_same_and_is_independent(bodies):
    kept = bodies.points.copy()
    again = load_open_bodies("coarse")
    for name in ("points", "subject", "pose", "betas", "pose_vectors", "translations"):
        np.testing.assert_array_equal(getattr(again, name), getattr(bodies, name))
        getattr(again, name)[...] = 0
    np.testing.assert_array_equal(bodies.points, kept)
    np.testing.assert_array_equal(load_open_bodies("coarse").points, kept)


@pytest.fixture(scope="module")
def natural():
    return load_open_bodies("coarse", variant="natural")


def test_ten_people_in_ten_poses(natural, bodies):
    assert natural.pose_names == tuple(read_table("open_poses")["natural"])
    np.testing.assert_array_equal(natural.subject, bodies.subject)
    np.testing.assert_array_equal(natural.pose, bodies.pose)
    assert len(set(natural.subject_names)) == len(set(natural.pose_names)) == 10
    gaps = np.linalg.norm(natural.betas[::10, None] - natural.betas[None, ::10], axis=-1)
    assert gaps[~np.eye(10, dtype=bool)].min() > 1.5  # standard deviations


def test_the_same_people_come_again_and_others_with_another_seed(natural, bodies):
    np.testing.assert_array_equal(natural.betas, bodies.betas)
    assert natural.subject_names == bodies.subject_names
    others, again = (load_open_bodies("coarse", "natural", people=2) for _ in range(2))
    np.testing.assert_array_equal(again.points, others.points)
    gaps = np.linalg.norm(others.betas[::10, None] - bodies.betas[None, ::10], axis=-1)
    assert gaps.min() > 1


# Places of vertex 100, written down with the people of ANSUR II: of those, poses and flesh.
WRITTEN = [
    ("plain", 37, (-0.1708051480503, 1.2210649201136, 0.0678733744205), 1e-9),
    ("natural", 8, (-0.2363288659623, 1.3690510313528, 0.0178155048661), 1e-6),
    ("natural", 44, (-0.1561079052784, 1.2227673774295, 0.0286672640697), 1e-6),
    ("natural", 73, (-0.1037229012875, 1.5015524787404, -0.0215781977280), 1e-6),
]


def test_numbers_are_those_written_down(bodies, natural):
    known = {"plain": bodies, "natural": natural}
    for variant, body, place, gap in WRITTEN:
        np.testing.assert_allclose(known[variant].points[body, 100], place, rtol=0, atol=gap)


def test_wrong_names_are_refused():
    for wrong in ({"resolution": "fine"}, {"variant": "real"}, {"people": -1}):
        with pytest.raises(ArgumentError, match=next(iter(wrong))):
            load_open_bodies(**{"resolution": "coarse"} | wrong)
