"""Messages name parts of a body as people do."""

import pytest

from riemhuman.registration._messages import (
    MARK_JOINTS,
    OPEN_HANDS,
    in_words,
    join_reasons,
    join_words,
    part_in_words,
    parts_in_words,
    say_unseen,
)


@pytest.mark.parametrize(
    ("joints", "parts"),
    [
        (["left_knee", "left_ankle", "left_toes"], ["left leg below the knee"]),
        (["left_knee", "left_ankle", "right_knee", "right_ankle"], ["legs below the knee"]),
        (["left_ankle", "right_ankle", "right_toes"], ["feet"]),
        (["left_hip", "left_knee", "left_ankle", "right_ankle"], ["left leg", "right foot"]),
        (["left_shoulder", "left_elbow", "left_wrist"], ["left arm"]),
        (["left_wrist", "right_elbow"], ["left hand", "right forearm"]),
        (["right_hip"], ["right thigh"]),
        (["pelvis", "lower_spine", "middle_spine", "upper_spine", "chest"], ["trunk"]),
        (["chest", "head"], ["chest", "head"]),
        (["bone_7"], ["bone 7"]),
        ([], []),
    ],
)
def test_parts_are_limbs_from_their_first_joint_on(joints, parts):
    assert parts_in_words(joints) == parts


def test_one_line_says_what_was_not_seen():
    legs = [f"{side}_{joint}" for side in ("left", "right") for joint in ("knee", "ankle", "toes")]
    assert say_unseen(legs, 0.21) == "the legs below the knee were not seen (21 % of the body)"
    assert say_unseen(["left_wrist"], 0.03).startswith("the left hand was not")
    assert say_unseen([], 0.31) == "31 % of the body was not seen"
    assert say_unseen([], 0.31, " under clothes") == "31 % of the body was not seen under clothes"


def test_words():
    assert in_words("left_knee") == "left knee"
    limbs = ("left_knee", "right_shoulder", "left_wrist", "left_toes")
    assert [part_in_words(joint) for joint in limbs] == [
        "left shin", "right upper arm", "left hand", "left toes",
    ]  # fmt: skip
    assert part_in_words("head") == "head"
    assert [join_words(list(some)) for some in ("", "a", "ab", "abc")] == [
        "", "a", "a and b", "a, b and c",
    ]  # fmt: skip


def test_what_to_do_is_said_once_and_last():
    reasons = [f"arms: a; {MARK_JOINTS}", f"hands: b; {OPEN_HANDS}", f"legs: c; {MARK_JOINTS}"]
    said = "; ".join(["arms: a", "hands: b", "legs: c", MARK_JOINTS, OPEN_HANDS])
    assert join_reasons(reasons) == said
    assert join_reasons(["the feet were not seen"]) == "the feet were not seen"
