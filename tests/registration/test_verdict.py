"""What is no single body is refused, and for the reason."""

import numpy as np
import pytest
from scanned_people import result_of_one_search, settings_with

import riemhuman as rh
from riemhuman.registration import ScanRegistration
from riemhuman.registration._limbs import BodyParts
from riemhuman.registration._scan_preparation import prepare_scan
from riemhuman.registration._shown_parts import find_seen
from riemhuman.registration._verdict import FitQuality, find_excess
from riemhuman.registration._verdict import find_doubts as find_doubts_of

GOOD = {
    "likelihood": 3.2,
    "margin": 0.4,
    "near": 0.99,
    "betas": 1.0,
    "far": 0.006,
    "limb": "left wrist",
    "limb_matched": 0.5,
}


def find_doubts(**qualities):
    return find_doubts_of(FitQuality(**qualities))


@pytest.mark.parametrize("change", [{}, {"near": 1.0, "limb_matched": 0.0}])
def test_good_evidence_and_limbs_out_of_sight_leave_no_doubt(change):
    assert find_doubts(**(GOOD | change)) == ([], [])


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"near": 0.6}, "only 60 % of the scan lies within 5 cm of the body"),
        ({"likelihood": 1.0}, "does not look like one person"),
        ({"margin": 0.05}, "faces or stands differently"),
        ({"betas": 4.5}, "far from all people"),
        ({"far": 0.04}, "5 % of the scan lies more than 4.0 cm from the model's surface"),
        ({"bare": 0.04}, "10 % of the scan of them lies more than 4.0 cm from the model's surface"),
        ({"bare": 0.005, "likelihood": 1.4}, "does not look like one person"),
        ({"near": 0.6, "near_metres": 0.15}, "only 60 % of the scan lies within 15 cm of the body"),
    ],
)
def test_every_doubt_has_its_reason(change, reason):
    (found,), of_limb = find_doubts(**(GOOD | change))
    assert reason in found
    assert "likelihood" not in found
    assert not of_limb


def test_in_clothes_only_bare_parts_tell():
    clothed = GOOD | {"far": 0.09, "likelihood": 1.8}
    assert find_doubts(**clothed)[0]
    assert find_doubts(**clothed, bare=0.005) == ([], [])


def test_a_limb_elsewhere_leaves_doubt_about_the_limb_alone():
    of_body, (found,) = find_doubts(**(GOOD | {"limb_matched": 0.1}))
    assert not of_body
    assert "hardly any of it matches the left wrist" in found


def test_straight_fingers_are_not_seen_in_a_scan_of_a_fist(model):
    straight, fist = (model(hands=model.hand_pose(name)) for name in ("open", "fist"))
    scan = prepare_scan(rh.registration.Scan(fist, model.faces))
    gaps = np.linalg.norm(straight - fist, axis=1)
    found = [find_seen(model.template, surface, gaps < 0.04, scan) for surface in (straight, fist)]
    assert found[0][gaps > 0.04].mean() < 0.1
    assert found[1].all()  # as in a hole, where fists are right


@pytest.mark.parametrize("misfit", [0.001, 0.004])
def test_limbs_are_compared_with_how_well_the_rest_fits(model, misfit):
    """However well a person and a scan fit as a whole, a limb twice as far is as doubtful."""
    parts = BodyParts(model)
    distances = np.full(model.n_vertices, misfit)
    same = find_excess(parts, parts.owners, distances)
    np.testing.assert_allclose(same, 1.0)
    for name in ("left_knee", "right_elbow"):
        (joint,) = parts.numbers(name)
        farther = np.where(parts.owners == joint, 2.0 * misfit, misfit)
        excess = find_excess(parts, parts.owners, farther)
        assert 1.8 < excess[joint] < 2.0 + 1e-9
        assert np.delete(excess, joint).max() < 1.0 + 1e-9
    # Of exact scans, hands are farther than the rest by nothing.
    exact = np.where(parts.on_hands, 1e-4, 1e-6)
    assert find_excess(parts, parts.owners, exact).max() <= 1.0
    # A hand elsewhere says nothing against its arm.
    on_hands = np.where(parts.on_hands, 5.0 * misfit, misfit)
    excess = find_excess(parts, parts.owners, on_hands)
    others = [not name.endswith("wrist") for name in parts.names]
    np.testing.assert_allclose(excess[others], 1.0)


@pytest.mark.slow
def test_a_body_the_wrong_way_round_is_refused():
    """The right start is left out, so that only the flipped body is there to be found."""
    model = rh.datasets.load_open_model("coarse")
    registration = ScanRegistration(model, up="y", settings=settings_with(n_headings=1))
    bodies = rh.datasets.load_open_bodies("coarse")
    # Both arms forward, no heading: a body that looks the other way is half a metre off.
    points = bodies[2]
    scan = rh.registration.simulated_scan(points, model.faces, 4, n_points=6000, rotate=False)
    backwards = np.array([-1.0, 1.0, -1.0])
    result = result_of_one_search(registration, backwards * scan.points)
    assert np.linalg.norm(result.points - backwards * scan.body, axis=1).mean() > 0.2
    assert not result.trusted
