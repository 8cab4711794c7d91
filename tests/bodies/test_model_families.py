"""Files of SMPL's relatives, made up: what is read of them and what is left out."""

import numpy as np
import pytest
from model_pickles import smpl_fields, smpl_pickle

from riemhuman.bodies import BodyModel, model_contents


def _smplx(n_coefficients, **more):
    fields = smpl_fields(n_joints=55, n_vertices=80, n_betas=n_coefficients)
    return fields | {"lmk_faces_idx": np.arange(5), "hands_meanl": np.zeros(45)} | more


def _star():
    fields = smpl_fields(n_vertices=80, n_betas=300)
    return fields | {"posedirs": np.zeros((80, 3, 93))}


CASES = {
    "SMPL": (smpl_fields(), 10, 207, ()),
    "SMPL-H": (smpl_fields(n_joints=52) | {"hands_meanl": np.zeros(45)}, 10, 459, ("hands",)),
    "SMPL-X": (_smplx(400), 10, 486, ("290 further", "100 expression", "hands", "face")),
    "SMPL-X of 10 and 10": (_smplx(20), 10, 486, ("10 expression", "hands", "face")),
    "STAR": (_star(), 10, None, ("posedirs (93 entries", "290 further")),
    "SMAL": (smpl_fields(n_joints=33, n_betas=41), 41, 288, ()),
}


@pytest.mark.parametrize("name", CASES)
def test_families(tmp_path, name):
    fields, n_betas, n_entries, left_out = CASES[name]
    np.savez(tmp_path / "model.npz", **fields)
    contents = model_contents(tmp_path / "model.npz")
    assert contents.family == name.split(" of ")[0]
    assert len(contents.left_out) == len(left_out)
    for found, expected in zip(contents.left_out, left_out, strict=True):
        assert expected in found
    model = BodyModel.from_file(tmp_path / "model.npz")
    assert model.n_betas == n_betas
    assert (None if model.posedirs is None else model.posedirs.shape[-1]) == n_entries
    assert f"{n_betas} shape coefficients" in str(contents)
    np.testing.assert_array_equal(model.shapedirs, fields["shapedirs"][..., :n_betas])


def test_pickles_say_the_same(tmp_path):
    fields = smpl_fields(n_joints=33, n_betas=41)
    (tmp_path / "smal.pkl").write_bytes(smpl_pickle(fields))
    contents = model_contents(tmp_path / "smal.pkl")
    assert contents.family == "SMAL"
    assert "33 joints" in contents.used


def test_expressions_are_never_taken_for_shape(tmp_path):
    np.savez(tmp_path / "model.npz", **_smplx(20))
    with pytest.raises(ValueError, match="n_betas is 12; .* has 10 shape coefficients"):
        BodyModel.from_file(tmp_path / "model.npz", n_betas=12)
