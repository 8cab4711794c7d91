"""The record of registered bodies and what it refuses."""

import numpy as np
import pytest

from riemhuman.datasets import Bodies
from riemhuman.errors import (
    ArgumentError,
    ArgumentTypeError,
    FileFormatError,
)
from riemhuman.io.arrays import save_arrays
from riemhuman.surfaces import Template

TEMPLATE = Template(np.eye(4, 3), [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])


def fields(**changes):
    rng = np.random.default_rng(0)
    values = {
        "points": rng.normal(size=(6, 4, 3)),
        "subject": [0, 0, 0, 1, 1, 1],
        "pose": [0, 1, 2, 0, 1, 2],
        "template": TEMPLATE,
        "subject_names": ["Ada", "Ben"],
        "pose_names": ["up", "down", "aside"],
        "betas": rng.normal(size=(6, 5)),
        "pose_vectors": rng.normal(size=(6, 2, 3)),
        "translations": rng.normal(size=(6, 3)),
    }
    return values | changes


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"points": np.zeros((6, 5, 3))}, r"points must have shape \(n_bodies, 4, 3\); found"),
        ({"subject": [0] * 5}, "subject must hold a label for each of 6 points; found 5"),
        ({"subject": [0, 0, 0, 1, 1, 2]}, "subject holds labels from 0 to 2; subject_names has"),
        ({"pose_names": ()}, "pose_names has only 0"),
        ({"betas": np.zeros((5, 5))}, r"betas must have shape \(6, n_betas\)"),
    ],
)
def test_refusals(changes, message):
    with pytest.raises(ArgumentError, match=message):
        Bodies(**fields(**changes))


def test_ids():
    assert Bodies(**fields()).ids == ("0", "1", "2", "3", "4", "5")
    assert Bodies(**fields(ids=list("abcdef"))).ids == tuple("abcdef")
    for ids in (list("abc"), list("abcdee")):
        with pytest.raises(ArgumentError, match="ids must hold a different name"):
            Bodies(**fields(ids=ids))


def test_a_number_gives_a_surface():
    bodies = Bodies(**fields())
    np.testing.assert_array_equal(bodies[2], bodies.points[2])
    np.testing.assert_array_equal(bodies[np.int64(-1)], bodies.points[5])
    assert len(list(bodies)) == 6


@pytest.mark.parametrize(
    ("index", "chosen"),
    [
        (slice(1, None, 2), [1, 3, 5]),
        ([4, 0, -1], [4, 0, 5]),
        (np.array([True, False, False, True, False, False]), [0, 3]),
        ([], []),
    ],
)
def test_slices_masks_and_numbers_give_bodies(index, chosen):
    bodies = Bodies(**fields(ids=list("abcdef")))
    some = bodies[index]
    for name in ("points", "subject", "pose", "betas", "pose_vectors", "translations"):
        np.testing.assert_array_equal(getattr(some, name), getattr(bodies, name)[chosen])
    assert some.ids == tuple("abcdef"[i] for i in chosen)
    assert some.subject_names == bodies.subject_names
    assert some.template is bodies.template


def test_select():
    bodies = Bodies(**fields())
    assert bodies.select(subject="Ben").ids == ("3", "4", "5")
    assert bodies.select(subject=0, pose=["aside", 0]).ids == ("0", "2")
    assert len(bodies.select()) == 6
    for wrong in ({"subject": "Eve"}, {"pose": 3}, {"pose": ["up", -1]}):
        with pytest.raises(ArgumentError, match="must be names or indices of"):
            bodies.select(**wrong)


def test_fields():
    values = fields()
    bodies = Bodies(**values)
    for name in ("points", "betas", "pose_vectors", "translations", "subject", "pose"):
        np.testing.assert_array_equal(getattr(bodies, name), values[name])
    assert bodies.subject.dtype == np.int64
    for name, wrong in (("subject", [0.5] * 6), ("betas", "many")):
        with pytest.raises(ArgumentTypeError, match=f"{name} must be an array of"):
            Bodies(**fields(**{name: wrong}))
    assert len(Bodies(np.zeros((0, 4, 3)), np.zeros(0, int), np.zeros(0, int), TEMPLATE)) == 0


@pytest.mark.parametrize("left_out", [(), ("betas", "pose_vectors", "translations")])
def test_save_and_load(tmp_path, left_out):
    bodies = Bodies(**fields(ids=list("abcdef"), **dict.fromkeys(left_out)))
    bodies.save(tmp_path / "bodies.npz")
    again = Bodies.load(tmp_path / "bodies.npz")
    for name in ("points", "subject", "pose", "betas", "pose_vectors", "translations"):
        np.testing.assert_array_equal(getattr(again, name), getattr(bodies, name))
    np.testing.assert_array_equal(again.template.vertices, TEMPLATE.vertices)
    np.testing.assert_array_equal(again.template.faces, TEMPLATE.faces)
    for name in ("subject_names", "pose_names", "ids"):
        assert getattr(again, name) == getattr(bodies, name)
    bodies[[]].save(tmp_path / "none.npz")
    assert len(Bodies.load(tmp_path / "none.npz")) == 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format_version": np.array(9)}, "format version 9"),
        ({"subject": np.full(6, 7)}, "subject holds labels"),
        ({"template_faces": np.full((4, 3), 9)}, "npz: "),
        ({"ids": np.zeros(())}, "npz: "),
        ({"subject": None}, "npz: "),
    ],
)
def test_files_that_are_refused(tmp_path, change, message):
    path = tmp_path / "bodies.npz"
    Bodies(**fields()).save(path)
    with np.load(path) as archive:
        arrays = dict(archive) | change
    save_arrays(path, {name: array for name, array in arrays.items() if array is not None})
    with pytest.raises(FileFormatError, match=message):
        Bodies.load(path)


def test_the_sex_is_the_last_word_of_a_name():
    bodies = Bodies(**fields(subject_names=["tall woman", "old man"]))
    assert bodies.sex.tolist() == ["woman"] * 3 + ["man"] * 3
    assert len(bodies[bodies.sex == "woman"]) == 3
    assert bodies[:0].sex.shape == (0,)
    assert set(Bodies(**fields()).sex.tolist()) == {""}
    assert Bodies(**fields(subject_names=["", "man"])).sex.tolist() == [""] * 3 + ["man"] * 3


def test_tables_of_pandas():
    some = Bodies(**fields())[[0, 1, 5]]
    table = some.to_frame()
    assert table.index.tolist() == ["0", "1", "5"]
    assert table.iloc[2].tolist() == ["Ben", "aside", ""]
    distances = np.array([[0.0, 1.0, 2.0], [1.0, 0.0, 3.0], [2.0, 3.0, 0.0]])
    table = some.to_frame(distances)
    assert table.loc["Ada, down", "Ben, aside"] == 3.0
    assert table.index.equals(table.columns)
    # The same person twice in one pose: names would not be unique.
    same = Bodies(**fields(pose=[0] * 6))[:3]
    assert same.to_frame(distances).columns.tolist() == ["0", "1", "2"]
    with pytest.raises(ArgumentError, match="between the 3 surfaces; found 2 rows"):
        some.to_frame(distances[:2, :2])
