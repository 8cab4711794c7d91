"""Sets of markers of laboratories: every joint is where an adult's markers say."""

import numpy as np
import pytest
from marker_files import RATE, write_trc
from recorded_people import joint_paths

from riemhuman.datasets import load_open_motions, load_trc, retarget
from riemhuman.errors import FileFormatError
from riemhuman.mocap._marker_sets import NEEDED, RECIPES, MarkerNames

# Half the breadths of an adult's joints with a marker, and of an adult's pelvis, metres.
KNEE, ANKLE, ELBOW, WRIST = 0.055, 0.042, 0.041, 0.030
SIDES = {"L": "left", "R": "right"}


@pytest.fixture(scope="module")
def standing():
    """Return the joints of a person who walks with lowered arms, and outward axes of the limbs."""
    (motion,) = load_open_motions("coarse", "average man", "knees", RATE)
    return joint_paths(motion)


def skin(joints):
    """Return places on the skin by role, and by "lateral", "medial" and others: (n_frames, 3)."""
    across = joints["left_hip"] - joints["right_hip"]
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    hips = 0.5 * (joints["left_hip"] + joints["right_hip"])
    up, ahead = np.array([0.0, 1.0, 0.0]), np.cross(across, [0.0, 1.0, 0.0])
    places = {}
    for letter, side in SIDES.items():
        sign = 1.0 if letter == "L" else -1.0
        for part, breadth in (("knee", KNEE), ("ankle", ANKLE), ("elbow", ELBOW)):
            joint = joints[f"{side}_{part}"]
            places[letter, part, "lateral"] = joint + sign * breadth * across
            places[letter, part, "medial"] = joint - sign * breadth * across
        wrist = joints[f"{side}_wrist"]
        places[letter, "wrist", "lateral"] = wrist + WRIST * ahead
        places[letter, "wrist", "medial"] = wrist - WRIST * ahead
        shoulder = joints[f"{side}_shoulder"]
        places[letter, "shoulder", "above"] = shoulder + 0.06 * up
        places[letter, "shoulder", "front"] = shoulder + 0.05 * ahead
        places[letter, "shoulder", "back"] = shoulder - 0.05 * ahead
        places[letter, "toes", "front"] = joints[f"{side}_toes"]
        # A pelvis 16 cm deep whose hips are where Harrington et al. have them.
        apart = np.linalg.norm(joints["left_hip"] - joints["right_hip"], axis=1).mean()
        width = (0.5 * apart - 0.0073) / 0.33
        middle = hips + (0.30 * width + 0.0109) * up + 0.0483 * ahead
        places[letter, "pelvis", "front"] = middle + sign * 0.5 * width * across
        places[letter, "pelvis", "back"] = middle - 0.16 * ahead + sign * 0.045 * across
    return places


def markers(joints, names):
    """Return markers from names by part and place, a pattern with {} for the side."""
    places = skin(joints)
    return {
        name.format(letter): places[letter, *where]
        for letter in SIDES
        for where, name in names.items()
    }


PLUG_IN_GAIT = {
    ("pelvis", "front"): "{}ASI", ("pelvis", "back"): "{}PSI", ("knee", "lateral"): "{}KNE",
    ("ankle", "lateral"): "{}ANK", ("toes", "front"): "{}TOE", ("shoulder", "above"): "{}SHO",
    ("elbow", "lateral"): "{}ELB", ("wrist", "lateral"): "{}WRA", ("wrist", "medial"): "{}WRB",
}  # fmt: skip
SETS = {
    "Plug-in Gait": PLUG_IN_GAIT,
    "CMU, 41 markers": PLUG_IN_GAIT | {("pelvis", "front"): "{}FWT", ("pelvis", "back"): "{}BWT"},
    "CMU, 53 markers": PLUG_IN_GAIT
    | {("pelvis", "front"): "{}FWT", ("pelvis", "back"): "{}BWT", ("shoulder", "front"): "{}FSH",
       ("shoulder", "back"): "{}BSH", ("wrist", "lateral"): "{}OWR", ("wrist", "medial"): "{}IWR"},
    "Rajagopal": PLUG_IN_GAIT
    | {("knee", "lateral"): "{}LFC", ("knee", "medial"): "{}MFC", ("ankle", "lateral"): "{}LMAL",
       ("ankle", "medial"): "{}MMAL", ("shoulder", "front"): "{}ASH",
       ("shoulder", "back"): "{}PSH", ("shoulder", "above"): "{}ACR", ("elbow", "lateral"): "{}LEL",
       ("elbow", "medial"): "{}MEL", ("wrist", "lateral"): "{}FAradius",
       ("wrist", "medial"): "{}FAulna"},
    "gait2354": {
        ("pelvis", "front"): "{}.ASIS", ("pelvis", "back"): "{}.PSIS",
        ("knee", "lateral"): "{}.Knee.Lat", ("knee", "medial"): "{}.Knee.Med",
        ("ankle", "lateral"): "{}.Ankle.Lat", ("ankle", "medial"): "{}.Ankle.Med",
        ("toes", "front"): "{}.Toe.Tip", ("shoulder", "above"): "{}.Acromium",
        ("elbow", "lateral"): "{}.Elbow", ("wrist", "lateral"): "{}.Wrist.Lat",
        ("wrist", "medial"): "{}.Wrist.Med",
    },
    "OptiTrack": PLUG_IN_GAIT
    | {("pelvis", "front"): "Waist{}Front", ("pelvis", "back"): "Waist{}Back",
       ("knee", "lateral"): "{}KneeOut", ("ankle", "lateral"): "{}AnkleOut",
       ("shoulder", "above"): "{}ShoulderTop", ("elbow", "lateral"): "{}ElbowOut"},
    "Xsens": {
        ("pelvis", "front"): "p{}ASI", ("knee", "lateral"): "p{}KneeLatEpicondyle",
        ("knee", "medial"): "p{}KneeMedEpicondyle", ("ankle", "lateral"): "p{}LatMalleolus",
        ("ankle", "medial"): "p{}MedMalleolus", ("toes", "front"): "p{}Toe",
        ("shoulder", "above"): "p{}Acromion", ("elbow", "lateral"): "p{}ArmLatEpicondyle",
        ("wrist", "lateral"): "p{}RadialStyloid", ("wrist", "medial"): "p{}UlnarStyloid",
        ("pelvis", "back"): "p{}PSIS",
    },
    "CGM 2, with a prefix": {where: f"251112_Kuo_{name}" for where, name in PLUG_IN_GAIT.items()}
    | {("knee", "medial"): "251112_Kuo_{}KNM", ("ankle", "medial"): "251112_Kuo_{}MED"},
    "sides of two letters": {
        ("pelvis", "front"): "{}xAsis", ("pelvis", "back"): "{}xPsis",
        ("knee", "lateral"): "{}xLatCon", ("ankle", "lateral"): "{}xLatMal",
        ("toes", "front"): "{}xToe1", ("shoulder", "above"): "{}xShould",
        ("elbow", "lateral"): "{}xElbow", ("wrist", "lateral"): "{}xWrist",
    },
}  # fmt: skip
# Single markers beside a joint leave more doubt, metres.
NEAR = {"hip": 0.01, "shoulder": 0.02, "elbow": 0.025, "wrist": 0.032}


@pytest.mark.filterwarnings("ignore:.*single markers on the skin")
def test_joints_are_near_their_centres(standing, tmp_path):
    for name, patterns in SETS.items():
        unnamed = {f"*{number}": np.full_like(standing["head"], number) for number in range(4)}
        file = write_trc(tmp_path / "a.trc", markers(standing, patterns) | unnamed)
        recording = load_trc(file)
        for role in (*NEEDED, "left_toes", "right_toes"):
            found = recording.positions[:, recording.joint_names.index(role)]
            apart = np.linalg.norm(found - standing[role], axis=1)
            assert np.median(apart) < NEAR.get(role.split("_")[1], 0.015), (name, role)


@pytest.mark.filterwarnings("ignore:.*single markers on the skin")
def test_legs_alone_are_performed(standing, tmp_path):
    """As in gait analysis: the upper body stands."""
    legs = {
        where: name
        for where, name in PLUG_IN_GAIT.items()
        if where[0] in ("pelvis", "knee", "ankle", "toes")
    }
    file = write_trc(tmp_path / "a.trc", markers(standing, legs))
    with pytest.warns(UserWarning, match="no markers tell where the trunk and the arms are"):
        motion = retarget(load_trc(file))
    names = [" to ".join(pair) for pair in motion.errors.bones]
    thighs = motion.errors.directions[:, names.index("left_hip to left_knee")]
    assert thighs.mean() < 4.0
    places = joint_paths(motion)
    assert np.all(places["left_wrist"][:, 1] < places["left_elbow"][:, 1])
    assert np.all(places["left_shoulder"][:, 1] > places["left_hip"][:, 1] + 0.3)


@pytest.mark.filterwarnings("ignore:.*single markers on the skin")
def test_what_is_lacking_is_said(standing, tmp_path):
    arms = {
        where: name for where, name in PLUG_IN_GAIT.items() if where[0] not in ("knee", "ankle")
    }
    file = write_trc(tmp_path / "a.trc", markers(standing, arms))
    message = "no markers that give the centre of left_knee, left_ankle, right_knee, right_ankle; "
    with pytest.raises(FileFormatError, match=message + ".*--joints FILE"):
        load_trc(file)
    one_wrist = {name: path for name, path in markers(standing, PLUG_IN_GAIT).items()
                 if not name.startswith("LWR")}  # fmt: skip
    with pytest.warns(UserWarning, match="no markers tell where left_wrist are"):
        load_trc(write_trc(tmp_path / "b.trc", one_wrist))


@pytest.mark.filterwarnings("ignore:.*single markers on the skin")
def test_a_marker_that_fell_off_is_not_waited_for(standing, tmp_path):
    """Another recipe is; of one that is hidden for a moment, the gap is filled."""
    paths = markers(standing, SETS["Rajagopal"])
    n_frames = len(paths["LMFC"])
    paths["LMFC"][n_frames // 2 :] = paths["RMFC"][10:12] = np.nan
    with pytest.warns(UserWarning, match="frames: right_knee up to 2$"):
        recording = load_trc(write_trc(tmp_path / "a.trc", paths))
    assert len(recording) == n_frames
    for role, near in (("left_knee", 0.02), ("right_knee", 0.002)):
        found = recording.positions[:, recording.joint_names.index(role)]
        assert np.linalg.norm(found - standing[role], axis=1).mean() < near


@pytest.mark.filterwarnings("ignore:.*single markers on the skin")
def test_people_on_treatment_tables_are_in_doubt(standing, tmp_path):
    """z points up; along y they stand, and nothing is below their feet."""
    paths = {
        name: np.array([2.0, -1.0, 0.7]) + path[:1] + 0.0 * path
        for name, path in markers(standing, PLUG_IN_GAIT).items()
    }
    recording = load_trc(write_trc(tmp_path / "a.trc", paths))
    with pytest.warns(UserWarning, match="y was taken to point up, but it might as well be z"):
        retarget(recording).pose_vectors  # noqa: B018


def test_sides_are_no_prefix():
    assert MarkerNames(["R_IAS", "R_IPS"]).corners() == {"right_asis": 0, "right_psis": 1}


def test_names_of_the_table_are_read():
    """No name is hidden by its side: "r" of "rsp" is not that of a right side."""
    for row in RECIPES:
        for names in row.names:
            for name in names:
                both = [f"L_{name}", f"R_{name}"]
                assert MarkerNames(both)._numbers["left", name] == 0, name
