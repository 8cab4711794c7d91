"""The AMASS reader, on made-up files in the layouts of its makers."""

import numpy as np
import pytest
from model_pickles import smpl_model
from recorded_people import joint_paths
from scipy.spatial.transform import Rotation

from riemhuman.datasets import Motion, load_amass, load_open_model, load_recording
from riemhuman.errors import ArgumentError, FileFormatError

TO_Y_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])


@pytest.fixture(scope="module")
def model():
    return smpl_model(52)


def smpl_h(n_frames=50, rng=0, rate=120.0, **changes):
    """Return the fields of a file in SMPL-H's layout."""
    rng = np.random.default_rng(rng)
    fields = {
        "trans": rng.normal(size=(n_frames, 3)),
        "gender": np.array("female"),
        "mocap_framerate": np.array(rate),
        "betas": rng.normal(size=16),
        "dmpls": rng.normal(size=(n_frames, 8)),
        "poses": 0.3 * rng.normal(size=(n_frames, 156)),
    }
    fields["poses"][:, 0] += np.pi / 2.0  # they stand along z
    return {name: value for name, value in (fields | changes).items() if value is not None}


def smpl_x(n_frames=20, rng=0, **changes):
    """Return the fields of a file in SMPL-X's layout."""
    rng = np.random.default_rng(rng)
    widths = {"root_orient": 3, "pose_body": 63, "pose_hand": 90, "pose_jaw": 3, "pose_eye": 6}
    fields = {
        "gender": np.array("neutral"),
        "surface_model_type": np.array("smplx"),
        "mocap_frame_rate": np.array(30),
        "trans": rng.normal(size=(n_frames, 3)),
        "betas": rng.normal(size=16),
    }
    fields |= {name: 0.3 * rng.normal(size=(n_frames, n)) for name, n in widths.items()}
    fields["root_orient"][:, 0] += np.pi / 2.0
    return {name: value for name, value in (fields | changes).items() if value is not None}


def write(path, fields):
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez(path, **fields)
    return path


def test_frames_are_those_of_the_model(tmp_path, model):
    fields = smpl_h()
    path = write(tmp_path / "CMU" / "07" / "07_02_poses.npz", fields)
    (motion,) = load_amass(path, model)
    assert isinstance(motion, Motion)
    np.testing.assert_array_equal(motion.betas, fields["betas"])
    for n_betas in (4, 20):  # they are cut, or filled up by zeros
        (other,) = load_amass(path, smpl_model(52, n_betas))
        expected = np.pad(fields["betas"], (0, 4))[:n_betas]
        np.testing.assert_array_equal(other.betas, expected)
    assert (motion.subject, motion.sequence, motion.gender) == ("07", "07_02", "female")
    assert motion.path == path
    assert (len(motion), motion.frames_per_second) == (50, 120)
    # In files, z points up.
    expected = model(fields["betas"], fields["poses"], fields["trans"]) @ TO_Y_UP.T
    np.testing.assert_allclose(motion[:], expected, atol=1e-12)
    np.testing.assert_allclose(motion[40:3:-9], expected[40:3:-9], atol=1e-12)
    again = model(motion.betas, motion.pose_vectors, motion.translations)
    np.testing.assert_allclose(again, motion[:], atol=1e-12)


@pytest.mark.parametrize("n_joints", [22, 24, 52, 55])
@pytest.mark.parametrize("layout", ["smpl_h", "smpl_x", "smpl_x poses", "smpl_h parts"])
def test_joints_of_both_file_and_model_are_used(tmp_path, n_joints, layout):
    model = smpl_model(n_joints)
    n_frames = 20
    if layout == "smpl_h":
        fields = smpl_h(n_frames)
        poses = fields["poses"]
        body, face, hands = poses[:, :66], np.zeros((n_frames, 9)), poses[:, 66:]
    else:
        fields = smpl_x(n_frames)
        body = np.concatenate([fields["root_orient"], fields["pose_body"]], axis=1)
        face = np.concatenate([fields["pose_jaw"], fields["pose_eye"]], axis=1)
        hands = fields["pose_hand"]
        if layout == "smpl_x poses":
            fields = smpl_x(n_frames, poses=np.concatenate([body, face, hands], axis=1))
        if layout == "smpl_h parts":
            fields = smpl_x(n_frames, pose_jaw=None, pose_eye=None)
            face = np.zeros((n_frames, 9))
    expected = {
        22: [body],
        24: [body, np.zeros((n_frames, 6))],
        52: [body, hands],
        55: [body, face, hands],
    }[n_joints]
    (motion,) = load_amass(write(tmp_path / "m_stageii.npz", fields), model)
    assert motion.sequence == "m"
    assert motion.frames_per_second == fields.get("mocap_framerate", 30)
    found = motion.pose_vectors.reshape(n_frames, -1)
    np.testing.assert_array_equal(found[:, 3:], np.concatenate(expected, axis=1)[:, 3:])


def test_genders_are_words(tmp_path, model):
    path = tmp_path / "a.npz"
    for gender in ("male", b"male", "b'male'", ["Male"]):
        assert load_amass(write(path, smpl_h(gender=np.array(gender))), model)[0].gender == "male"
    assert load_amass(write(path, smpl_h(gender=None)), model)[0].gender == "neutral"


def test_a_folder_is_all_its_motions(tmp_path, model):
    for rng, name in enumerate(["B/s2/x_poses.npz", "A/s1/y_poses.npz", "A/s1/x_poses.npz"]):
        write(tmp_path / name, smpl_h(rng=rng))
    write(tmp_path / "A" / "s1" / "shape.npz", {"betas": np.zeros(16)})
    write(tmp_path / "A" / "s1" / "neutral_stagei.npz", {"betas": np.zeros(16)})
    (tmp_path / "A" / "LICENSE.txt").write_text("…")
    motions = load_amass(tmp_path, model)
    assert [(m.subject, m.sequence) for m in motions] == [("s1", "x"), ("s1", "y"), ("s2", "x")]


def test_a_file_that_was_written_again(tmp_path, model):
    path = write(tmp_path / "a.npz", smpl_h())
    load_amass(path, model)[0][0]
    write(path, smpl_h(rng=1))
    np.testing.assert_array_equal(load_amass(path, model)[0].betas, smpl_h(rng=1)["betas"])


def walking(n_frames=80, rate=40.0, leg=0.78):
    """Return the fields of a file: walking forward, with z up, at 1.2 metres a second."""
    times = np.arange(n_frames) / rate
    poses = np.zeros((n_frames, 52, 3))
    swing = 0.45 * np.sin(2.0 * np.pi * times / 1.1)
    # The feet move back at the speed of the legs that stand; arms hang and swing, elbows bend.
    poses[:, 0, 0] = np.pi / 2.0
    poses[:, 1, 0], poses[:, 2, 0] = swing, -swing
    poses[:, 16, 2], poses[:, 17, 2] = -1.2, 1.2
    poses[:, 18, 1], poses[:, 19, 1] = -0.5 + swing, 0.5 + swing
    steps = leg * np.abs(np.diff(np.sin(swing), prepend=0.0))
    trans = np.stack([np.zeros(n_frames), -np.cumsum(steps), np.full(n_frames, 1.1)], axis=1)
    return smpl_h(n_frames, rate=rate, poses=poses.reshape(n_frames, -1), trans=trans)


def test_either_axis_may_point_up(tmp_path, model):
    fields = walking()
    (motion,) = load_amass(write(tmp_path / "z.npz", fields), model)
    assert motion.up == "z"
    root = np.array([0.0, -0.22, 0.03])
    fields["trans"] = (fields["trans"] + root) @ TO_Y_UP.T - root
    fields["poses"][:, :3] = 0.0
    (motion,) = load_amass(write(tmp_path / "y.npz", fields), model)
    assert motion.up == "y"


def test_sleepers_whose_feet_are_at_zero_look_as_if_they_stood(tmp_path, model):
    fields = walking()
    fields["poses"][:] = 0.0
    fields["trans"][:] = [0.4, 1.1, 0.15]
    (motion,) = load_amass(write(tmp_path / "sleep.npz", fields), model)
    with pytest.warns(UserWarning, match="y was taken to point up, but it might as well be z"):
        motion.up  # noqa: B018


def test_the_open_model(tmp_path):
    path = write(tmp_path / "ann" / "walk_poses.npz", walking())
    model = load_open_model("coarse")
    with pytest.warns(UserWarning, match="belong to SMPL's models and are ignored") as warned:
        (motion,) = load_amass(path, frames_per_second=20)
    assert {warning.filename for warning in warned} == {__file__}
    assert (motion.subject, motion.sequence, len(motion)) == ("ann", "walk", 40)
    assert motion[3].shape == (model.n_vertices, 3)
    joints = joint_paths(motion)

    def degrees(first, second, expected):
        a, b = joints[second] - joints[first], expected
        return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.sum(a * b, axis=1)))

    poses = walking()["poses"].reshape(-1, 52, 3)[::2]
    root = Rotation.from_matrix(TO_Y_UP) * Rotation.from_rotvec(poses[:, 0])
    # In SMPL's rest pose arms point to the sides, nearly level.
    upper = root * Rotation.from_rotvec(poses[:, 16])
    assert degrees("left_shoulder", "left_elbow", upper.apply([26, -1, -3])).max() < 5
    lower = upper * Rotation.from_rotvec(poses[:, 18])
    assert degrees("left_elbow", "left_wrist", lower.apply([25, 1, 0])).max() < 5
    assert motion.errors.directions.max() < 5.0
    # Walking along −y, with z up, is walking along z.
    moved = motion.translations[-1] - motion.translations[0]
    assert moved[2] > 0.9 * np.linalg.norm(moved) > 0.5
    other = motion.performed_by(np.ones(model.n_betas))
    assert other.errors.directions.max() < 5.0


def test_models_of_other_trees(tmp_path, model):
    path = write(tmp_path / "a.npz", smpl_h())
    chain = smpl_model(24, kintree_table=[[-1, *range(23)], range(24)])
    with pytest.raises(ArgumentError, match="joints must name left_hip, .*; the skeleton has"):
        load_amass(path, chain)


def test_what_files_hold_besides(tmp_path, model):
    """Real files of SMPL-X hold a dictionary; rates and betas may have axes of length one."""
    markers = np.array({"LFHD": 3}, dtype=object)
    plain = smpl_x()
    path = tmp_path / "a_stageii.npz"
    fields = plain | {"markers_latent_vids": markers, "mocap_frame_rate": np.array([30.0])}
    np.savez(path, **fields | {"betas": np.tile(plain["betas"], (20, 1))})
    (motion,) = load_amass(path, model)
    (expected,) = load_amass(write(tmp_path / "b.npz", plain), model)
    np.testing.assert_array_equal(motion[3], expected[3])
    write(tmp_path / "c.npz", plain | {"betas": np.arange(40.0).reshape(20, 2)})
    with pytest.raises(FileFormatError, match=r"betas must describe one person; .*\(20, 2\)"):
        load_amass(tmp_path / "c.npz", model)[0][0]


def test_rates_that_a_file_does_not_state_are_given(tmp_path, model):
    path = write(tmp_path / "a.npz", smpl_h(mocap_framerate=None))
    for load in (load_recording, lambda *chosen, **given: load_amass(*chosen, **given)[0]):
        assert load(path, model, frames_per_second=25.0, up="z").frames_per_second == 25.0
        with pytest.raises(FileFormatError, match=r"a\.npz does not state its frame rate"):
            load(path, model)


WRONG = {
    "no poses": (smpl_h(poses=None), "lacks the fields poses; found betas, dmpls, gender"),
    "another length": (
        smpl_h(poses=np.zeros((49, 156))),
        r"poses must have shape \(50, 66 or 72 or 156 or 165\); found \(49, 156\)",
    ),
    "no frames": (smpl_h(0), r"trans must have shape \(n_frames, 3\); found \(0, 3\)"),
    "frame rate of no camera": (
        smpl_h(rate=1e300),
        "mocap_framerate must be at most 1e\\+09",
    ),
    "gender a number": (smpl_h(gender=np.array(3)), "gender must be a word; found int64"),
    "pickled": (smpl_h(gender=np.array([{}], dtype=object)), "Object arrays"),
}


def test_wrong_files(tmp_path, model):
    for name, (fields, message) in WRONG.items():
        path = write(tmp_path / f"{name}.npz", fields)
        with pytest.raises(FileFormatError, match=rf"{name}\.npz:? .*{message}"):
            load_amass(path, model)


def test_numbers_that_are_no_motion(tmp_path, model):
    for name in ("poses", "trans", "betas"):
        for number, found in (
            (np.nan, "holds 1 NaN"),
            (1e20, "must have entries of at most 1e.09"),
        ):
            fields = smpl_h()
            fields[name].ravel()[5] = number
            (motion,) = load_amass(write(tmp_path / f"{number}.npz", fields), model)
            with pytest.raises(FileFormatError, match=rf"npz: {name} {found}"):
                motion[0]
