"""The verb convert-model, on a synthetic model in SMPL's layout."""

import pickle

import numpy as np
import pytest

from riemhuman.bodies import BodyModel
from riemhuman.datasets import load_open_model


@pytest.fixture(scope="module")
def fields():
    model = load_open_model("coarse")
    return {
        "v_template": model.template.vertices,
        "f": model.faces,
        "shapedirs": model.shapedirs,
        "J_regressor": model.joint_regressor,
        "weights": model.weights,
        "kintree_table": np.stack([model.parents, np.arange(model.n_joints)]),
    }


def test_pickle_becomes_plain_arrays(run, fields, tmp_path):
    source, target = tmp_path / "model.pkl", tmp_path / "model.npz"
    source.write_bytes(pickle.dumps(fields, protocol=2))
    finished = run("convert-model", source, "-o", target, "--n-betas", 4)
    assert finished.code == 0, finished.err
    assert "1,202 vertices" in finished.out
    assert "4 shape coefficients" in finished.out
    with np.load(target, allow_pickle=False) as saved:
        np.testing.assert_array_equal(saved["v_template"], fields["v_template"])
    model = BodyModel.from_file(target)
    original = load_open_model("coarse")
    expected = original(np.pad(np.arange(4.0), (0, original.n_betas - 4)))
    np.testing.assert_allclose(model(np.arange(4.0)), expected, atol=1e-12)
    assert "body model" in run("info", source).out


def test_code_in_a_pickle_is_named_and_not_run(refused, tmp_path):
    source = tmp_path / "model.pkl"
    source.write_bytes(b"cos\nsystem\n(S'touch " + str(tmp_path / "run").encode() + b"'\ntR.")
    message = refused("convert-model", source, "-o", tmp_path / "model.npz")
    assert "os.system" in message or "os system" in message or "posix.system" in message
    refused("info", source)
    assert list(tmp_path.iterdir()) == [source]


def test_failures(refused, fields, tmp_path):
    source = tmp_path / "model.pkl"
    source.write_bytes(pickle.dumps({"f": fields["f"]}, protocol=2))
    assert "absent.pkl" in refused("convert-model", "absent.pkl", "-o", tmp_path / "model.npz")
    assert "v_template" in refused("convert-model", source, "-o", tmp_path / "model.npz")
    assert "ending must be .npz" in refused("convert-model", source, "-o", tmp_path / "m.pkl")
    (tmp_path / "model.npz").touch()
    assert "exists" in refused("convert-model", source, "-o", tmp_path / "model.npz")
