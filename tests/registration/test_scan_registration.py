"""Scans of bodies become those bodies; what is no body is refused."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

import riemhuman as rh
from riemhuman.kernels.surface import vertex_normals
from riemhuman.registration import ScanRegistration, _start_search, simulated_scan


def errors(result, scan):
    return np.linalg.norm(result.points - scan.body, axis=1)


def test_the_body_is_found(result, scan):
    assert result.trusted, result.message
    assert errors(result, scan).mean() < 0.006
    assert errors(result, scan).max() < 0.03


def test_the_model_fit_is_the_body_before_its_elastic_step(registration, result):
    fit = result.fit
    surface = registration.model(fit.betas, fit.pose, fit.trans, fit.hands)
    gaps = np.linalg.norm(surface - result.points, axis=1)
    np.testing.assert_allclose(gaps, result.fit.distances, atol=1e-9)
    assert gaps.mean() < 0.01


def test_correspondence_leads_to_the_nearest_places(registration, result, scan):
    corners = result.points[registration.model.faces[result.correspondence.triangles]]
    places = np.einsum("nk,nkx->nx", result.correspondence.barycentric, corners)
    gaps = np.linalg.norm(places - scan.points, axis=1)
    np.testing.assert_allclose(gaps, result.distances, atol=1e-12)
    nearest, _ = cKDTree(result.points).query(scan.points)
    assert np.all(result.distances <= nearest + 1e-12)


@pytest.mark.slow
def test_other_units_axes_and_normals_change_nothing(registration, result, scan):
    # From y up to z up.
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    points, faces = 1000.0 * scan.points @ turn.T, scan.faces[:, ::-1]
    other = ScanRegistration(registration.model, up="z").solve((points, faces))
    assert (other.trusted, other.unit) == (True, "millimetres")
    assert np.linalg.norm(other.points @ turn - result.points, axis=1).mean() < 0.002


@pytest.mark.slow
def test_a_sequence_starts_from_the_scan_before(registration, scan, result, frames, monkeypatch):
    rotation = np.linalg.lstsq(frames[0], scan.body)[0]
    faces = registration.model.faces
    later = simulated_scan(frames[1] @ rotation, faces, rng=5, n_points=6000, rotate=False)
    monkeypatch.setattr(_start_search, "search_starts", None)  # no cold start any more
    second = registration.solve(later.points, start=result)
    assert second.trusted
    assert errors(second, later).mean() < 0.008


def test_a_sequence_shows_its_progress_and_keeps_what_is_finished(
    registration, result, scan, monkeypatch, capsys
):
    starts = []

    def solve(self, scan, *, start=None):
        starts.append(start)
        if len(starts) == 3:
            raise KeyboardInterrupt
        return result

    monkeypatch.setattr(ScanRegistration, "solve", solve)
    found = registration.solve_sequence([scan.points] * 4, progress=True)
    assert found == [result, result]
    assert starts == [None, result, result]
    assert "Scans:" in capsys.readouterr().err
    assert registration.solve_sequence([scan.points] * 4) == [result] * 4
    assert capsys.readouterr().err == ""


@pytest.mark.slow
def test_vertices_outside_the_view_are_not_matched(registration_from, frames):
    registration = registration_from("forward")
    faces, front = registration.model.faces, (0, 0, 1)
    scan = simulated_scan(frames[0], faces, rng=3, n_points=6000, view=front, rotate=False)
    found = registration.solve(scan.points)
    assert found.trusted, found.message
    normals = vertex_normals(scan.body, faces)
    assert found.matched[normals[:, 2] > 0.8].mean() > 0.6
    assert found.matched[normals[:, 2] < -0.5].mean() < 0.08  # 0.095 if any normals matched


@pytest.mark.slow
def test_two_people_are_refused(registration, scan):
    both = np.concatenate([scan.points, scan.points + [0.9, 0.0, 0.4]])
    found = registration.solve(both, trace=True)
    assert not found.trusted
    assert "more than one person" in found.message
    assert found.trace.arms.hand_fits == {}  # no details of a body that is refused
    assert "not seen" not in found.message  # nor about its parts


def test_a_landmark_needs_a_joint(registration, scan):
    with pytest.raises(rh.errors.ArgumentError, match=r"landmarks has 'left_nose'; the joints"):
        registration.solve(scan.points, landmarks={"left_nose": [0, 0, 0]})


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"model": "SMPL.npz"}, rh.errors.ArgumentTypeError, "model must be a BodyModel"),
        ({"up": "upward"}, rh.errors.ArgumentError, "up must be"),
        ({"unit": "feet"}, rh.errors.ArgumentError, "unit must be"),
    ],
)
def test_wrong_choices_are_refused(registration, arguments, error, message):
    with pytest.raises(error, match=message):
        ScanRegistration(**({"model": registration.model} | arguments))


@pytest.mark.slow
def test_offsets_are_removed_in_double_precision(registration, scan):
    # Rounded so that no sum is: the scan far away and the one near the origin have the same bits.
    points = np.round(scan.points * 2.0**20) / 2.0**20
    offset = np.array([5e5, 3e3, 5e6])  # as in coordinates of a map
    removed = np.round(np.median(points + offset, axis=0))
    far = registration.solve((points + offset, scan.faces))
    near = registration.solve((points + offset - removed, scan.faces))
    assert far.trusted == near.trusted
    np.testing.assert_array_equal(far.points, near.points + removed)
    np.testing.assert_array_equal(far.scan.points, points + offset)
    np.testing.assert_array_equal(far.fit.trans, near.fit.trans + removed)
    np.testing.assert_array_equal(far.distances, near.distances)
    # The motion to upright axes rounds as coordinates of 5,000 km do.
    np.testing.assert_allclose(far.upright_points, near.upright_points, atol=1e-7)


@pytest.mark.slow
def test_a_trace_keeps_every_stage(few_starts, scan, result):
    found = few_starts.solve(scan.surface, trace=True)
    assert result.trace is None
    np.testing.assert_array_equal(found.points, result.points)
    trace = found.trace
    surfaces = trace.surfaces()
    assert list(surfaces) == ["start", "search", "dense fit", "arms and hands", "elastic step"]
    np.testing.assert_array_equal(surfaces["elastic step"], found.points)
    off = [np.linalg.norm(points - scan.body, axis=1).mean() for points in surfaces.values()]
    assert off[0] > 3.0 * off[1]  # the search brings the start to the scan
    assert max(off[2:]) < off[1]  # and the later stages bring it closer
    counts = [len(trace.search.starts), *map(len, trace.search.rounds)]
    assert counts == sorted(counts, reverse=True)
    assert trace.search.candidates[0].likelihood == max(
        candidate.likelihood for candidate in trace.search.candidates
    )
    assert trace.verdict.trusted == found.trusted
    assert list(trace.seconds) == ["search", "dense fit", "arms and hands", "elastic step", "trust"]
    assert min(trace.seconds.values()) > 0.0
