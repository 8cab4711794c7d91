"""A generator in place of an array or a list raises a typed error, or is read like a list."""

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.errors import ArgumentError, ArgumentTypeError, FileFormatError

D = np.abs(np.subtract.outer(*[np.array([0.0, 1.0, 5.0, 6.0])] * 2))


@pytest.fixture(scope="module")
def bodies():
    return rh.datasets.load_open_bodies("coarse")


def each(values):
    return (value for value in values)


@pytest.mark.parametrize(
    ("call", "error"),
    [
        (lambda b: rh.io.save_arrays("a.npz", {"x": each([1.0])}), ArgumentTypeError),
        (lambda b: rh.io.load_arrays("b.npz", each(["y"]), []), FileFormatError),
        (lambda b: rh.retrieval.local_scaling(each(D), 1), ArgumentTypeError),
        (lambda b: rh.path_job(None, rh.VectorSpace((1,)).metric, each(D), "c"), ArgumentTypeError),
        (lambda b: b.select(subject=each(["nobody"])), ArgumentError),
        (lambda b: b.select(pose=1.5), ArgumentError),
        (lambda b: rh.datasets.pose_vectors(each(D), b.model), ArgumentTypeError),
        (lambda b: rh.datasets.joint_rotations({"elbow": ("q", 1)}, b.model), ArgumentError),
        (lambda b: rh.bodies.joint_motions(each(D), D, [-1], (0,)), ArgumentTypeError),
    ],
)
def test_what_is_no_array(call, error, bodies, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rh.io.save_arrays("b.npz", {"x": [1.0]})
    with pytest.raises(error):
        call(bodies)


def test_what_is_read_like_a_list(bodies):
    assert bodies.select(subject=each([1, 2])).ids == bodies.select(subject=[1, 2]).ids
    assert rh.retrieval.scores(D, each("aabb")) == rh.retrieval.scores(D, "aabb")
    assert rh.retrieval.confusion(D, each("aabb")).tolist() == [[2, 0], [0, 2]]
