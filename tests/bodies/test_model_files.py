"""Files of body models: SMPL's pickles and archives in the layouts that are about."""

import pickle
import pickletools

import numpy as np
import pytest
from model_pickles import ch, old_sparse, pickled, smpl_fields, smpl_pickle
from scipy import sparse

from riemhuman.bodies import BodyModel, convert_model, model_contents
from riemhuman.errors import ArgumentError, FileFormatError

FIELDS = smpl_fields()
REGRESSOR = sparse.csc_matrix(FIELDS["J_regressor"])
NAMES = {
    "faces": "f",
    "shapedirs": "shapedirs",
    "joint_regressor": "J_regressor",
    "weights": "weights",
    "posedirs": "posedirs",
}


def written(path, content):
    path.write_bytes(content)
    return path


def archive(path, **changes):
    fields = {name: value for name, value in (FIELDS | changes).items() if value is not None}
    np.savez(path, **fields)
    return path


def assert_same(model, fields=FIELDS, atol=0.0):
    np.testing.assert_array_equal(model.template.vertices, fields["v_template"])
    for name, field in NAMES.items():
        np.testing.assert_allclose(getattr(model, name), fields[field], rtol=0, atol=atol)
    assert model.parents[0] == -1
    np.testing.assert_array_equal(model.parents[1:], fields["kintree_table"][0, 1:])


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    return BodyModel.from_file(archive(tmp_path_factory.mktemp("smpl") / "model.npz"))


@pytest.mark.parametrize(("protocol", "name"), [(0, "model.pkl"), (2, "MODEL.PICKLE")])
def test_smpl_pickles_are_read_like_archives(tmp_path, reference, protocol, name):
    content = smpl_pickle(FIELDS, protocol)
    names = [argument for _, argument, _ in pickletools.genops(content)] if protocol else []
    if protocol:
        assert "chumpy.reordering Select" in names
        assert "scipy.sparse.csc csc_matrix" in names
    model = BodyModel.from_file(written(tmp_path / name, content))
    assert_same(model)
    assert (model.n_joints, model.posedirs.shape[-1]) == (24, 207)
    rng = np.random.default_rng(1)
    betas, pose, trans = (0.5 * rng.normal(size=shape) for shape in [(2, 10), (2, 24, 3), (2, 3)])
    np.testing.assert_array_equal(model(betas, pose, trans), reference(betas, pose, trans))


@pytest.mark.parametrize("protocol", [0, pickle.HIGHEST_PROTOCOL])
def test_pickles_of_this_python(tmp_path, protocol):
    fields = FIELDS | {"J_regressor": sparse.csc_matrix(FIELDS["J_regressor"])}
    fields["weights"] = np.asfortranarray(fields["weights"])
    fields["joint_names"] = np.array([f"bone {j}" for j in range(24)])
    content = pickle.dumps(fields, protocol=protocol)
    model = BodyModel.from_file(written(tmp_path / "model.pkl", content))
    assert_same(model)
    assert model.joint_names[3] == "bone 3"


@pytest.mark.parametrize(("module", "kind"), [("csc", "matrix"), ("_csc", "array")])
def test_sparse_regressors(tmp_path, module, kind):
    changed = old_sparse(REGRESSOR, f"scipy.sparse.{module} csc_{kind}")
    path = written(tmp_path / "model.pkl", pickled(FIELDS | {"J_regressor": changed}))
    assert_same(BodyModel.from_file(path))


@pytest.mark.parametrize(
    "change",
    [
        lambda p: p.reshape(180, 207),
        lambda p: p.reshape(180, 207).T,
        lambda p: np.moveaxis(p, -1, 0),
    ],
)
def test_layouts_of_posedirs(tmp_path, change):
    posedirs = change(FIELDS["posedirs"])
    assert_same(BodyModel.from_file(archive(tmp_path / "m.npz", posedirs=posedirs)))
    path = written(tmp_path / "m.pkl", pickled(FIELDS | {"posedirs": ch(posedirs)}))
    assert_same(BodyModel.from_file(path))


def test_many_shape_coefficients(tmp_path):
    many = smpl_fields(n_betas=300)
    path = archive(tmp_path / "m.npz", shapedirs=many["shapedirs"])
    assert BodyModel.from_file(path).n_betas == 10
    for n_betas in (0, 1, 16, 300):
        found = BodyModel.from_file(path, n_betas=n_betas).shapedirs
        np.testing.assert_array_equal(found, many["shapedirs"][..., :n_betas])
    sixteen = archive(tmp_path / "h.npz", shapedirs=many["shapedirs"][..., :16])
    assert BodyModel.from_file(sixteen).n_betas == 16
    with pytest.raises(ArgumentError, match=r"n_betas is 17; .*h\.npz has 16"):
        BodyModel.from_file(sixteen, n_betas=17)


def test_conversion(tmp_path):
    source = written(tmp_path / "model.pkl", smpl_pickle(FIELDS))
    converted = convert_model(source, tmp_path / "model.npz")
    assert_same(converted)
    with np.load(tmp_path / "model.npz", allow_pickle=False) as fields:
        assert {fields[name].dtype.kind for name in fields.files} <= set("fiU")
        assert fields["posedirs"].shape == (60, 3, 207)
    assert_same(BodyModel.from_file(tmp_path / "model.npz"))
    assert convert_model(source, tmp_path / "few.npz", n_betas=3).n_betas == 3
    assert BodyModel.from_file(tmp_path / "few.npz").n_betas == 3


@pytest.mark.everyday
@pytest.mark.parametrize("name", [name for name in FIELDS if name != "posedirs"])
def test_missing_fields_are_named(tmp_path, name):
    fields = {other: value for other, value in FIELDS.items() if other != name}
    path = written(tmp_path / "model.pkl", pickled(fields))
    with pytest.raises(FileFormatError, match=rf"model\.pkl: lacks the fields {name}; found \w+, "):
        BodyModel.from_file(path)


def sparse_with(**changes):
    return {"J_regressor": old_sparse(REGRESSOR, **changes)}


@pytest.mark.everyday
@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"J_regressor": FIELDS["J_regressor"][:23]}, r"weights must have shape \(60, 23\)"),
        ({"J_regressor": old_sparse(REGRESSOR[:23])}, r"shape of weights, \(60, 24\), transposed"),
        (sparse_with(_shape=(2**40, 60)), "J_regressor must have the shape of weights"),
        ({"posedirs": FIELDS["posedirs"][..., :198]}, r"posedirs must have shape \(60, 3, 207\)"),
    ],
)
def test_malformed_fields(tmp_path, changes, message):
    path = written(tmp_path / "model.pkl", pickled(FIELDS | changes))
    with pytest.raises(FileFormatError, match=rf"model\.pkl:? .*({message})"):
        BodyModel.from_file(path)


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


def test_expressions_are_no_shape_coefficients(tmp_path):
    np.savez(tmp_path / "model.npz", **_smplx(20))
    with pytest.raises(ValueError, match="n_betas is 12; .* has 10 shape coefficients"):
        BodyModel.from_file(tmp_path / "model.npz", n_betas=12)


def test_models_in_another_unit_are_refused(tmp_path):
    template = FIELDS["v_template"] * [0.5, 1.0, 0.2] / np.ptp(FIELDS["v_template"][:, 1])
    for size, unit in ((170.0, "centimetres"), (1700.0, "millimetres")):
        with pytest.raises(FileFormatError, match=f"long, as a body in {unit} is; .* in metres"):
            BodyModel.from_file(archive(tmp_path / "model.npz", v_template=size * template))
    # A hand, in metres.
    BodyModel.from_file(archive(tmp_path / "model.npz", v_template=0.2 * template))
