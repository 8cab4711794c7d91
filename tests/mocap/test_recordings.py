"""The one reader of recordings: every format gives the poses that were written."""

import gzip
import pickle
import zlib
from pathlib import Path

import numpy as np
import pytest
from model_pickles import Call, pickled
from scipy.spatial.transform import Rotation
from torch_files import Tensor, torch_file

from riemhuman.datasets import RetargetedMotion, load_recording, recording_contents
from riemhuman.errors import ArgumentError, FileFormatError

FOLDER = Path(__file__).parent / "recordings"
N_FRAMES = 6
RNG = np.random.default_rng(0)
POSES = 0.2 * RNG.normal(size=(N_FRAMES, 24, 3))
PLACES = RNG.normal(size=(N_FRAMES, 3))
BETAS = RNG.normal(size=10)
ROWS = POSES.reshape(N_FRAMES, 72)
MATRICES = Rotation.from_rotvec(POSES.reshape(-1, 3)).as_matrix().reshape(N_FRAMES, 24, 3, 3)


def aist(path):
    content = {"smpl_loss": 0.5, "smpl_poses": ROWS, "smpl_scaling": np.array([90.0])}
    path.write_bytes(pickle.dumps(content | {"smpl_trans": 90.0 * PLACES}))


def wham(path):
    person = {"pose_world": ROWS, "trans_world": PLACES, "betas": np.tile(BETAS, (N_FRAMES, 1))}
    camera = {"pose": ROWS + 1.0, "trans": PLACES + 1.0, "verts": np.zeros((N_FRAMES, 5, 3))}
    path.write_bytes(pickle.dumps({0: person | camera}))


def gvhmr(path):
    params = {
        "body_pose": Tensor(ROWS[:, 3:66].astype(np.float32), "FloatStorage"),
        "global_orient": Tensor(ROWS[:, :3]),
        "transl": Tensor(PLACES),
        # One row for all frames, as `expand` makes it.
        "betas": Tensor(BETAS, shape=(N_FRAMES, 10), strides=(0, 1)),
    }
    turned = params | {"global_orient": Tensor(ROWS[:, :3] + 1.0)}
    torch_file(path, {"smpl_params_incam": turned, "smpl_params_global": params})


def four_d_humans(path):
    frames = {
        f"img/{frame:06d}.jpg": {
            "tid": [1],
            "camera": [PLACES[frame]],
            "smpl": [
                {
                    "global_orient": MATRICES[frame, :1],
                    "body_pose": MATRICES[frame, 1:],
                    "betas": BETAS,
                }
            ],
        }
        for frame in range(N_FRAMES)
    }
    path.write_bytes(zlib.compress(pickle.dumps(frames)))


def four_d_humans_plain(path):
    frames = {
        frame: {
            "global_orient": MATRICES[frame, None, :1],
            "body_pose": MATRICES[frame, None, 1:],
            "pred_cam_t": PLACES[frame, None],
            "betas": BETAS[None],
        }
        for frame in range(N_FRAMES)
    }
    path.write_bytes(gzip.compress(pickle.dumps(frames)))


def tram(path):
    content = {
        "pred_rotmat": Tensor(MATRICES),
        "pred_shape": Tensor(np.tile(BETAS, (N_FRAMES, 1))),
        "pred_trans": Tensor(PLACES[:, None]),
    }
    torch_file(path, content, folder="results")


def romp(path):
    betas = np.tile(BETAS, (N_FRAMES, 1))
    np.savez(path, smpl_thetas=ROWS, smpl_betas=betas, cam_trans=PLACES)


WRITERS = {
    "aist.pkl": aist,
    "wham.pkl": wham,
    "gvhmr.pt": gvhmr,
    "four_d_humans.pkl": four_d_humans,
    "four_d_humans_plain.pickle": four_d_humans_plain,
    "tram.pth": tram,
    "romp.npz": romp,
}


@pytest.mark.parametrize("name", WRITERS)
def test_poses_of_video_methods(tmp_path, smpl, name):
    file = tmp_path / name
    WRITERS[name](file)
    rate = None if name == "aist.pkl" else 30.0
    motion = load_recording(file, smpl, up="y", frames_per_second=rate)
    poses = POSES.copy()
    if name == "gvhmr.pt":
        poses[:, 22:] = 0.0  # it has no hands
    betas = np.zeros(10) if name == "aist.pkl" else BETAS
    np.testing.assert_allclose(motion[:], smpl(betas, poses, PLACES), atol=1e-6)
    assert motion.frames_per_second == (60.0 if name == "aist.pkl" else 30.0)
    assert motion.sequence == file.stem


@pytest.mark.parametrize("compress", [0, 3])
def test_files_of_joblib(tmp_path, smpl, compress):
    joblib = pytest.importorskip("joblib")
    person = {"pose_world": np.asfortranarray(ROWS), "trans_world": PLACES, "betas": BETAS}
    joblib.dump({"a": person}, tmp_path / "a.pkl", compress=compress)
    motion = load_recording(tmp_path / "a.pkl", smpl, up="y", frames_per_second=30.0)
    np.testing.assert_allclose(motion[:], smpl(BETAS, POSES, PLACES), atol=1e-12)


def test_skeletons_and_amass(tmp_path, smpl):
    walk = load_recording(FOLDER / "cmu_01_01.bvh", frames_per_second=10.0)
    assert isinstance(walk, RetargetedMotion)
    assert walk.frames_per_second == 10.0
    still = load_recording(FOLDER / "cmu_01_01.amc", betas=np.zeros(walk.model.n_betas))
    assert still.frames_per_second == 120.0
    assert not still.betas.any()
    poses = np.pad(ROWS[:, :66], ((0, 0), (0, 90)))
    fields = {"poses": poses, "trans": PLACES, "betas": np.zeros(16), "gender": "male"}
    np.savez(tmp_path / "a.npz", mocap_framerate=60.0, **fields)
    assert len(load_recording(tmp_path / "a.npz", smpl, up="z")) == N_FRAMES
    other = load_recording(tmp_path / "a.npz", smpl, up="z", betas=BETAS)
    np.testing.assert_array_equal(other.betas, BETAS)


def test_several_people(tmp_path, smpl):
    long = {"pose_world": ROWS, "trans_world": PLACES, "fps": 30}
    short = {"pose_world": ROWS[2:4], "trans_world": PLACES[2:4], "fps": 30}
    (tmp_path / "two.pkl").write_bytes(pickle.dumps({7: short, 9: long}))
    with pytest.warns(UserWarning, match=r"two.pkl holds 2 people \(7, 9\); person 9, seen in 6"):
        assert len(load_recording(tmp_path / "two.pkl", smpl, up="y")) == N_FRAMES
    assert len(load_recording(tmp_path / "two.pkl", smpl, up="y", person="7")) == 2
    with pytest.raises(ArgumentError, match="person must be one of 7, 9; found '8'"):
        load_recording(tmp_path / "two.pkl", smpl, person="8")


def test_rates(tmp_path, smpl):
    romp(tmp_path / "a.npz")
    assert load_recording(tmp_path / "a.npz", smpl, up="y", frames_per_second=25.0).n_frames == 6
    with pytest.raises(FileFormatError, match="does not state its frame rate: pass frames_per"):
        load_recording(tmp_path / "a.npz", smpl, up="y")
    wham(tmp_path / "b.pkl")
    with pytest.warns(UserWarning, match="b.pkl does not state its frame rate; 30 a second"):
        load_recording(tmp_path / "b.pkl", smpl, up="y")
    aist(tmp_path / "a.pkl")
    slow = load_recording(tmp_path / "a.pkl", smpl, up="y", frames_per_second=30.0)
    np.testing.assert_allclose(slow.translations, PLACES[::2], atol=1e-12)


@pytest.mark.everyday
@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.pkl", pickle.dumps({"verts": ROWS, "cam": 1.0}), "it holds cam, verts"),
        ("a.pkl", pickle.dumps({"p": {"poses": ROWS}}), "it holds poses"),
        ("a.pkl", pickled({"a": Call("os system", ("true",))}), r"asks for os\.system"),
        ("a.pkl", zlib.compress(pickle.dumps({"p": ROWS}))[:-20], "not a whole pickle"),
        ("a.mp4", b"", r"\.bvh, .*\.glb; found '\.mp4'"),
    ],
)
def test_refused_files(tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FileFormatError, match=message):
        load_recording(tmp_path / name)


def avatar(path, **changes):
    """Write a .smpl file as Meshcapade's codec does: version 2 is SMPL-X."""
    fields = {
        "codecVersion": np.int32(2),
        "smplVersion": np.int32(2),
        "gender": np.int32(0),
        "shapeParameters": BETAS.astype(np.float32),
        "frameCount": np.int32(N_FRAMES),
        "frameRate": np.float32(24.0),
        "bodyTranslation": PLACES.astype(np.float32),
        "bodyPose": POSES[:, :22].astype(np.float32),
        "leftHandPose": np.zeros((N_FRAMES, 15, 3), np.float32),
        "expressionParameters": np.zeros((N_FRAMES, 10), np.float32),
        **changes,
    }
    with path.open("wb") as file:
        np.savez_compressed(file, **{k: v for k, v in fields.items() if v is not None})
    return path


def test_avatars_of_smpl_files(smpl, tmp_path):
    path = avatar(tmp_path / "walk.smpl", frameRate=np.array([24.0], np.float32))
    motion = load_recording(path, smpl, up="y")
    assert motion.frames_per_second == 24.0
    np.testing.assert_allclose(motion.pose_vectors[:, :22], POSES[:, :22], atol=1e-6)
    np.testing.assert_allclose(motion.translations, PLACES, atol=1e-6)
    np.testing.assert_allclose(motion.betas, BETAS, atol=1e-6)
    still = ("frameCount", "frameRate", "bodyTranslation", "bodyPose", "leftHandPose")
    still += ("expressionParameters",)
    path = avatar(tmp_path / "still.smpl", **dict.fromkeys(still))
    (body,) = load_recording(path, smpl, up="y")[:]
    np.testing.assert_allclose(body, smpl(BETAS), atol=1e-6)
    for version, joints in ((0, 24), (1, 22), (3, 22), (6, 24), (7, 22)):
        path = avatar(
            tmp_path / "other.smpl", smplVersion=np.int32(version), bodyPose=POSES[:, :joints]
        )
        found = load_recording(path, smpl, up="y").pose_vectors
        np.testing.assert_allclose(found[:, :joints], POSES[:, :joints], atol=1e-6)


@pytest.mark.everyday
@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"smplVersion": np.int32(5)}, "poses of SKEL, 46 angles"),
        ({"smplVersion": np.int32(9)}, "must be from 0 to 7; found 9"),
        ({"bodyPose": POSES}, r"bodyPose must have shape \(6, 22, 3\); found \(6, 24, 3\)"),
        ({"frameCount": np.array([1, 2])}, "frameCount must be a whole number"),
        ({"frameCount": np.int32(0)}, "frameCount must be a whole number of at least 1"),
        ({"frameRate": np.float32(-1.0)}, "frameRate"),
        ({"frameCount": np.int32(2**31 - 1), "bodyPose": None}, "bodyTranslation must have"),
    ],
)
def test_bad_avatars_are_refused(tmp_path, changes, message):
    with pytest.raises(FileFormatError, match=rf"bad\.smpl: .*({message}|NaN)"):
        load_recording(avatar(tmp_path / "bad.smpl", **changes), up="y")


def test_files_of_the_codec_itself(smpl, tmp_path):
    codec = pytest.importorskip("smplcodec")
    written = codec.SMPLCodec(
        smpl_version=codec.SMPLVersion.SMPLX,
        shape_parameters=BETAS,
        frame_count=N_FRAMES,
        frame_rate=24.0,
        body_translation=PLACES,
        body_pose=POSES[:, :22],
        head_pose=POSES[:, :3],
    )
    written.write(str(tmp_path / "walk.smpl"))
    motion = load_recording(tmp_path / "walk.smpl", smpl, up="y")
    np.testing.assert_allclose(motion.pose_vectors[:, :22], POSES[:, :22], atol=1e-6)
    np.testing.assert_allclose(motion.translations, PLACES, atol=1e-6)
    contents = recording_contents(tmp_path / "walk.smpl")
    assert "headPose (jaw and eyes, of SMPL-X)" in contents.used
    assert contents.left_out == ("codecVersion", "gender (model to choose)")


def test_what_is_used_of_a_file_and_what_is_left_out(tmp_path):
    contents = recording_contents(avatar(tmp_path / "walk.smpl"))
    assert {"bodyPose", "bodyTranslation", "frameRate", "shapeParameters"} <= {*contents.used}
    assert "leftHandPose (fingers, of models that have them)" in contents.used
    assert "expressionParameters (expression of the face)" in contents.left_out
    aist(tmp_path / "dance.pkl")
    contents = recording_contents(tmp_path / "dance.pkl")
    assert contents.used == ("smpl_poses", "smpl_scaling", "smpl_trans")
    assert contents.left_out == ("smpl_loss",)
    amass = {"poses": np.zeros((4, 156)), "trans": np.zeros((4, 3)), "betas": np.zeros(16)}
    amass |= {"dmpls": np.zeros((4, 8)), "mocap_framerate": 30.0, "gender": "female"}
    np.savez(tmp_path / "amass.npz", **amass)
    contents = recording_contents(tmp_path / "amass.npz")
    assert contents.left_out == ("dmpls (soft tissue)",)
    nested = {"smpl_params_global": {"global_orient": ROWS[:, :3], "body_pose": ROWS[:, 3:66]}}
    nested["smpl_params_global"] |= {"transl": PLACES, "betas": BETAS}
    nested |= {"K_fullimg": np.eye(3), "net_outputs": {"confidence": np.ones(N_FRAMES)}}
    (tmp_path / "video.pkl").write_bytes(pickle.dumps(nested))
    contents = recording_contents(tmp_path / "video.pkl")
    assert contents.used == ("betas", "body_pose", "global_orient", "transl")
    assert contents.left_out == ("K_fullimg", "confidence")
