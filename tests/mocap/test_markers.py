"""Recordings of markers: names of several makers, units, gaps, other markers and damaged files.

The truth is an open motion: its joints are written as markers, and performed by the same person.
"""

from pathlib import Path

import numpy as np
import pytest
from marker_files import CENTRES, RATE, centres, write_c3d, write_trc

from riemhuman.datasets import load_c3d, load_recording, load_trc, retarget
from riemhuman.errors import ArgumentError, FileFormatError
from riemhuman.kernels.surface import unit_vectors
from riemhuman.mocap._marker_sets import NEEDED

FOLDER = Path(__file__).parent / "recordings"
PARTS = ("hip", "knee", "ankle", "shoulder", "elbow", "wrist", "toes")
# Markers on the skin are so far beside joints, metres.
BESIDE = 0.045
KEYPOINTS = ("Hip", "Knee", "Ankle", "Shoulder", "Elbow", "Wrist", "BigToe")


def sided(joints, pattern, parts, sides=("L", "R")):
    """Return the joints on both sides as markers of other names."""
    return {
        pattern.format(side=side, part=part): joints[f"{ours}_{role}"]
        for ours, side in zip(("left", "right"), sides, strict=True)
        for role, part in zip(PARTS, parts, strict=True)
        if part
    }


def pairs(joints, names, sides):
    """Return two markers on the skin beside each joint on both sides."""
    found = {}
    across = np.array([BESIDE, 0.0, 0.0])
    for ours, side in zip(("left", "right"), sides, strict=True):
        for role, pair in names.items():
            for name, sign in zip(pair, (1.0, -1.0), strict=True):
                found[name.format(side=side)] = joints[f"{ours}_{role}"] + sign * across
    return found


def opencap(joints):
    """Video keypoints that are off, and markers that a network computed from them."""
    wrong = {name: path + 0.05 for name, path in sided(joints, "{side}{part}", KEYPOINTS).items()}
    for side, ours in (("L", "left"), ("R", "right")):
        wrong[f"{side}Shoulder"] = joints[f"{ours}_shoulder"]
    names = {
        "knee": ("{side}_knee_study", "{side}_mknee_study"),
        "ankle": ("{side}_ankle_study", "{side}_mankle_study"),
        "elbow": ("{side}_lelbow_study", "{side}_melbow_study"),
        "wrist": ("{side}_lwrist_study", "{side}_mwrist_study"),
    }
    hips = {
        f"{side}HJC_study": joints[f"{ours}_hip"] for side, ours in (("L", "left"), ("R", "right"))
    }
    skin = {
        f"{side}_shoulder_study": joints[f"{ours}_shoulder"] + 0.05
        for side, ours in (("L", "left"), ("r", "right"))
    }
    return wrong | pairs(joints, names, ("L", "r")) | hips | skin


MAKERS = {
    "video": lambda joints: sided(joints, "{side}{part}", KEYPOINTS) | {"Neck": joints["neck"]},
    "OpenCap": opencap,
    "centres": centres,
}


@pytest.fixture
def video(joints):
    return {name: path.copy() for name, path in MAKERS["video"](joints).items()}


def places(recording, role):
    return recording.positions[:, recording.joint_names.index(role)]


@pytest.mark.parametrize("maker", MAKERS)
def test_joints_are_where_names_of_markers_say(maker, joints, tmp_path):
    recording = load_trc(write_trc(tmp_path / "jump.trc", MAKERS[maker](joints)))
    assert (recording.frames_per_second, recording.unit) == (RATE, "metres")
    for role in NEEDED:
        np.testing.assert_allclose(places(recording, role), joints[role], atol=1e-6)
    rotations = recording.global_rotations
    np.testing.assert_allclose(
        rotations @ np.swapaxes(rotations, -1, -2),
        np.broadcast_to(np.eye(3), rotations.shape),
        atol=1e-9,
    )


@pytest.mark.parametrize("upright", ["y", "z"])
def test_a_body_performs_what_markers_recorded(upright, jump, video, tmp_path):
    if upright == "z":
        video = {name: path[:, [2, 0, 1]] for name, path in video.items()}
    motion = load_recording(write_trc(tmp_path / "jump.trc", video), jump.model, betas=jump.betas)
    assert motion.errors.directions.max() < 4.0
    assert motion.errors.positions.max() < 0.02
    assert motion.errors.scale == pytest.approx(1.0, abs=1e-4)
    if upright == "y":
        apart = np.linalg.norm(motion[::8] - jump[::8], axis=-1)
        # Collars were not recorded: the farther shoulders are from hips, the higher they are.
        assert apart.mean() < 0.02


def test_bent_knees_turn_about_the_axis_of_the_knee(joints, video, tmp_path):
    recording = load_trc(write_trc(tmp_path / "jump.trc", video))
    upper = unit_vectors(joints["left_knee"] - joints["left_hip"])
    lower = unit_vectors(joints["left_ankle"] - joints["left_knee"])
    bends = np.cross(upper, lower)
    deepest = np.argmax(np.linalg.norm(bends, axis=1))
    number = recording.joint_names.index("left_knee")
    # In the rest pose, x points to the left, and the shank down.
    turned = recording.global_rotations[deepest, number]
    assert turned[:, 0] @ unit_vectors(bends[deepest]) > np.cos(np.radians(10.0))
    np.testing.assert_allclose(turned @ [0.0, -1.0, 0.0], lower[deepest], atol=1e-6)


def test_units_are_those_of_the_file_if_it_names_any(joints, video, tmp_path):
    for unit in ("cm", "m"):
        recording = load_trc(write_trc(tmp_path / "jump.trc", video, unit))
        np.testing.assert_allclose(places(recording, "left_knee"), joints["left_knee"], atol=1e-5)
    file = write_trc(tmp_path / "jump.trc", video, "?")
    assert load_trc(file).unit is None
    assert load_trc(file, unit="m").unit == "metres"
    with pytest.warns(UserWarning, match="unit="):
        load_trc(file, unit="mm")


@pytest.mark.parametrize("missing", ["", "NaN", "0.00000"])
def test_short_gaps_are_interpolated_and_said(missing, joints, video, tmp_path):
    video["LKnee"][10:12] = np.nan
    file = write_trc(tmp_path / "jump.trc", video, missing=missing)
    with pytest.warns(UserWarning, match="left_knee up to 2"):
        recording = load_trc(file)
    assert len(recording) == len(joints["left_knee"])
    np.testing.assert_allclose(places(recording, "left_knee"), joints["left_knee"], atol=0.02)


def test_frames_at_both_ends_without_markers_are_left_out(joints, video, tmp_path):
    n_frames = len(video["LKnee"])
    video["LKnee"][:10] = np.nan
    video["RWrist"][-3:] = np.nan
    with pytest.warns(UserWarning, match=f"only frames 11 to {n_frames - 3} of {n_frames}"):
        recording = load_trc(write_trc(tmp_path / "jump.trc", video))
    np.testing.assert_allclose(
        places(recording, "left_knee"), joints["left_knee"][10:-3], atol=1e-6
    )


@pytest.mark.filterwarnings("ignore:.*no markers tell where left_wrist")
def test_long_gaps_are_refused_unless_nothing_needs_them(video, tmp_path):
    video["LBigToe"][5:25] = np.nan
    with pytest.warns(UserWarning, match="left_toes was left out"):
        recording = load_trc(write_trc(tmp_path / "jump.trc", video))
    assert "left_toes" not in recording.joint_names
    n_frames = len(video["LKnee"])
    whole = video["LWrist"].copy()
    video["LWrist"][5:] = np.nan
    with pytest.warns(UserWarning, match="left_wrist was left out"):
        assert len(load_trc(write_trc(tmp_path / "jump.trc", video))) == n_frames
    video["LWrist"] = whole
    video["LKnee"][5:25] = np.nan
    with pytest.warns(UserWarning, match=f"only frames 26 to {n_frames} of {n_frames}"):
        recording = load_trc(write_trc(tmp_path / "jump.trc", video))
    assert len(recording) == n_frames - 25
    video["LKnee"][:] = np.nan
    video["LKnee"][::8] = 0.5
    with pytest.raises(FileFormatError, match="left_knee in .* % of the frames"):
        load_trc(write_trc(tmp_path / "jump.trc", video))


def test_a_recipe_without_values_gives_way_to_another(joints, video, tmp_path):
    video["LKJC"] = np.full_like(video["LKnee"], np.nan)
    recording = load_trc(write_trc(tmp_path / "jump.trc", video))
    np.testing.assert_allclose(places(recording, "left_knee"), joints["left_knee"], atol=1e-6)


def test_missing_joints_are_named_with_the_markers_of_the_file(joints, video, tmp_path):
    video["Gamba"] = video.pop("LKnee")
    file = write_trc(tmp_path / "jump.trc", video)
    with pytest.raises(FileFormatError, match="the centre of left_knee; its markers are.*Gamba"):
        load_trc(file)
    for told in ("Gamba", ["Gamba", "Gamba"]):
        recording = load_trc(file, joints={"left_knee": told})
        np.testing.assert_allclose(places(recording, "left_knee"), joints["left_knee"], atol=1e-6)
    assert len(load_recording(file, joints={"left_knee": "Gamba"})) == len(recording)
    with pytest.raises(ArgumentError, match="must be one of"):
        load_trc(file, joints={"left_knee": "Knie"})
    with pytest.raises(ArgumentError, match="joints must name some of"):
        load_trc(file, joints={"tail": "Gamba"})


def test_in_laboratories_a_knee_is_the_skin_beside_it(joints, video, tmp_path):
    video |= {"LASI": joints["left_hip"], "RASI": joints["right_hip"]}
    with pytest.warns(UserWarning, match="left_knee.* on the skin"):
        load_trc(write_trc(tmp_path / "jump.trc", video))


def test_hips_from_the_corners_of_the_pelvis(joints, video, tmp_path):
    del video["LHip"], video["RHip"]
    for part, centre in zip(KEYPOINTS[1:6], list(CENTRES.values())[1:6], strict=True):
        video |= {f"{side}{centre}": video.pop(f"{side}{part}") for side in "LR"}
    # A pelvis 24 cm wide that stands upright, facing the front.
    middle = 0.5 * (joints["left_hip"] + joints["right_hip"])
    for name, place in {
        "LASI": (0.12, 0.07, 0.05),
        "RASI": (-0.12, 0.07, 0.05),
        "LPSI": (0.04, 0.07, -0.10),
        "RPSI": (-0.04, 0.07, -0.10),
    }.items():
        video[name] = middle + np.array(place)
    file = write_trc(tmp_path / "jump.trc", video)
    # Harrington et al. (2007), 15 cm deep and 24 cm wide, from the middle of the front corners.
    expected = middle + [
        0.33 * 0.24 + 0.0073,
        0.07 - 0.30 * 0.24 - 0.0109,
        0.05 - 0.24 * 0.15 - 0.0099,
    ]
    np.testing.assert_allclose(places(load_trc(file), "left_hip"), expected, atol=1e-6)
    # One marker at the back is halfway between two.
    video["SACR"] = 0.5 * (video.pop("LPSI") + video.pop("RPSI"))
    file = write_trc(tmp_path / "jump.trc", video)
    np.testing.assert_allclose(places(load_trc(file), "left_hip"), expected, atol=1e-6)
    # Corners under other names are told.
    corners = {"left_asis": "Vorn1", "right_asis": "Vorn2", "sacrum": "Hinten"}
    for ours, theirs in zip(("LASI", "RASI", "SACR"), corners.values(), strict=True):
        video[theirs] = video.pop(ours)
    told = load_trc(write_trc(tmp_path / "jump.trc", video), joints=corners)
    np.testing.assert_allclose(places(told, "left_hip"), expected, atol=1e-6)


@pytest.mark.parametrize("mark", [":", "_"])
def test_of_several_people_one_is_taken(mark, joints, tmp_path):
    both = {f"Ben{mark}{name}": path + 1.0 for name, path in MAKERS["centres"](joints).items()}
    both |= {f"Anna{mark}{name}": path for name, path in MAKERS["centres"](joints).items()}
    file = write_trc(tmp_path / "both.trc", both)
    with pytest.warns(UserWarning, match="2 people"):
        recording = load_trc(file)
    np.testing.assert_allclose(places(recording, "left_hip"), joints["left_hip"] + 1.0, atol=1e-6)
    anna = load_trc(file, joints={"left_hip": f"Anna{mark}LHJC"})
    np.testing.assert_allclose(places(anna, "right_wrist"), joints["right_wrist"], atol=1e-6)


def test_the_head_turns_as_its_markers_do(joints, video, tmp_path):
    centre = joints["head"]
    angle = np.linspace(0.0, 0.5, len(centre))
    left = np.stack([np.cos(angle), np.zeros_like(angle), -np.sin(angle)], axis=1)
    ahead = np.stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)], axis=1)
    video |= {"LEar": centre + 0.07 * left, "REar": centre - 0.07 * left}
    video["Nose"] = centre + 0.1 * ahead
    recording = load_trc(write_trc(tmp_path / "jump.trc", video))
    number = recording.joint_names.index("head")
    np.testing.assert_allclose(recording.global_rotations[:, number, :, 0], left, atol=1e-4)
    assert "head" in retarget(recording).errors.parts


@pytest.mark.everyday
@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda text: "", "Frame#"),
        (lambda text: "\n".join(text.splitlines()[:6]), "0 frames follow"),
        (lambda text: text.replace("\n3\t", "\n3\toops\t", 1), "columns expected|could not"),
        (lambda text: text.replace("20.0", "-20.0", 2), "frame rate"),
        (lambda text: text.replace("20.0", "fast", 1), "datarate"),
        (lambda text: text.rpartition("\t")[0] + "\n", "columns expected"),
    ],
)
def test_damaged_files(damage, message, video, tmp_path):
    file = write_trc(tmp_path / "jump.trc", video)
    file.write_text(damage(file.read_text()))
    with pytest.raises(FileFormatError, match=message):
        load_trc(file)


def test_files_with_fewer_frames_than_they_say(video, tmp_path):
    file = write_trc(tmp_path / "jump.trc", video)
    text = file.read_text()
    file.write_text(text[: len(text) // 2].rpartition("\n")[0])
    with pytest.warns(UserWarning, match="NumFrames says 49, but 24 frames follow"):
        assert len(load_trc(file)) == 24


def test_files_with_other_separators_and_headers(joints, video, tmp_path):
    files = [write_trc(tmp_path / "spaces.trc", video, missing="NaN", tabs=False)]
    text = write_trc(tmp_path / "tabs.trc", video).read_text()
    first, keys, values, names, *rows = text.split("\n")
    pairs = [f"{key}\t{value}" for key, value in zip(keys.split(), values.split(), strict=True)]
    triples = [f"{name}{end}" for name in video for end in ("_x", "_y", "_z")]
    written = {
        "pairs": [first, "\t".join(pairs), "", names, *rows],
        "triples": [first, keys, values, "\t".join(["Frame #", "Time", *triples]), *rows],
        "decimals": [first, keys, values, names, *(row.replace(".", ",") for row in rows)],
    }
    for name, lines in written.items():
        files.append(tmp_path / f"{name}.trc")
        files[-1].write_text("\n".join(lines))
    named = {f"A {name}": path for name, path in video.items()}
    for mark, name in ((",", "commas"), (";", "semicolons")):
        files.append(write_trc(tmp_path / f"{name}.trc", named))
        files[-1].write_text(files[-1].read_text().replace("\t", mark).replace("A ", ""))
    for file in files:
        recording = load_trc(file)
        np.testing.assert_allclose(places(recording, "left_hip"), joints["left_hip"], atol=1e-6)
        assert recording.unit == "metres"


@pytest.mark.parametrize("rate", ["20 Hz", "20,0", 0])
def test_rates_with_units_and_commas_and_from_times(rate, video, tmp_path):
    header = {"DataRate": rate, "CameraRate": 0}
    recording = load_trc(write_trc(tmp_path / "jump.trc", video, header=header))
    assert recording.frames_per_second == pytest.approx(20.0, rel=1e-3 if rate == 0 else 1e-12)
    assert recording.unit == "metres"


def test_c3d_files_are_read_as_trc_files(jump, joints, video, tmp_path):
    video["LKnee"][10] = np.nan
    file = write_c3d(tmp_path / "jump.c3d", video)
    with pytest.warns(UserWarning, match="left_knee up to 1"):
        recording = load_c3d(file)
    assert (recording.frames_per_second, recording.unit) == (RATE, "metres")
    np.testing.assert_allclose(places(recording, "left_hip"), joints["left_hip"], atol=1e-5)
    with pytest.warns(UserWarning, match="left_knee up to 1"):
        motion = load_recording(file, jump.model, betas=jump.betas)
    assert motion.errors.positions.max() < 0.02
