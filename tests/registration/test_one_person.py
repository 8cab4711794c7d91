"""Several scans of one person get one shape, and what one does not show follows from the others."""

from dataclasses import replace

import numpy as np
import pytest

from riemhuman.errors import ArgumentError
from riemhuman.registration import ScanRegistration, register_folder, simulated_scan
from riemhuman.registration._limbs import BodyParts
from riemhuman.registration._one_person import find_borrowed, fit_together, shape_shown
from riemhuman.registration.scan_registration import share_person

FRONT, BACK = (0.0, 0.1, 1.0), (0.0, 0.1, -1.0)


@pytest.fixture(scope="module")
def scans(model, natural_bodies):
    """Return scans of one person from the front and the back, and of another person."""
    bodies = natural_bodies.points[[20, 20, 40]]
    return [
        simulated_scan(body, model.faces, k, n_points=8000, view=view)
        for k, (body, view) in enumerate(zip(bodies, (FRONT, BACK, FRONT), strict=True))
    ]


@pytest.fixture(scope="module")
def alone(registration_from, scans):
    return [registration_from("a").solve(scan.points, trace=True) for scan in scans]


@pytest.fixture(scope="module")
def together(alone):
    return share_person(alone[:2])


def test_both_scans_have_one_shape(alone, together):
    before, after = (
        np.linalg.norm(first.fit.betas - second.fit.betas)
        for first, second in (alone[:2], together)
    )
    assert before > 0.3
    assert after < 0.01 * before


def test_what_one_scan_does_not_show_follows_from_the_other(scans, alone, together):
    for scan, first, result in zip(scans, alone, together, strict=False):
        before, after = (np.linalg.norm(r.points - scan.body, axis=1) for r in (first, result))
        unseen = ~first.trusted_vertices
        borrowed = result.trusted_vertices & unseen
        assert result.trusted
        assert borrowed.mean() > 0.1
        assert (first.trusted_vertices <= result.trusted_vertices).all()
        assert after[borrowed].mean() < 0.9 * before[borrowed].mean()
        assert after[borrowed].max() < 0.05
        assert after.mean() < before.mean()
        assert "% of the body is known from the other scans" in result.message


def test_another_person_is_left_out(alone, together):
    first, second, other = share_person(alone)
    np.testing.assert_allclose(first.points, together[0].points, atol=1e-12)
    np.testing.assert_allclose(second.points, together[1].points, atol=1e-12)
    np.testing.assert_array_equal(other.points, alone[2].points)
    said = "; its shape differs from that of the other scans"
    assert other.message.startswith(alone[2].message + said)


def test_untrusted_scans_and_single_ones_stay_as_they_are(alone):
    refused = replace(alone[1], trusted=False, message="refused")
    first, second = share_person([alone[0], refused])
    assert first.message == alone[0].message
    np.testing.assert_array_equal(first.points, alone[0].points)
    assert second.message == "refused"
    assert fit_together([]) == []


def test_a_scan_counts_for_what_it_shows(alone):
    trace = alone[0].trace
    names = np.array(trace.task.body.parts.names)
    arms = np.flatnonzero(np.char.find(names, "elbow") >= 0)
    without = trace.task.visible & ~trace.task.body.parts.vertices(arms)
    samples = trace.task.samples
    fewer = replace(
        trace.task, samples=samples._replace(areas=samples.areas * without[samples.numbers])
    )
    whole, partial = (shape_shown(task, trace.elastic.pose)[0] for task in (trace.task, fewer))
    assert np.linalg.eigvalsh(whole).min() > 0.0
    assert np.trace(partial) < 0.99 * np.trace(whole)


def test_only_parts_that_the_scan_shows_without_doubt_borrow(model):
    parts = BodyParts(model)
    knee, elbow, wrist, hip = (
        parts.numbers(f"left_{name}")[0] for name in ("knee", "elbow", "wrist", "hip")
    )
    everything = np.ones(model.n_vertices, bool)
    own = everything.copy()
    for joint in (knee, elbow, wrist, hip):
        own[np.flatnonzero(parts.owners == joint)[:2]] = False
    head = parts.vertices(parts.numbers("head"))
    own[head] = False
    doubtful = ~own & (parts.owners == elbow)
    moved = np.where(parts.owners == hip, 0.01, 0.005)
    borrowed = find_borrowed(parts, own, own | doubtful, moved, everything)
    np.testing.assert_array_equal(borrowed, ~own & (parts.owners == knee))


def test_clothes_and_sequences_are_not_registered_together(model, tmp_path):
    clothed = ScanRegistration(model, clothed=True)
    with pytest.raises(ArgumentError, match="without clothes"):
        clothed.solve_together([])
    with pytest.raises(ArgumentError, match="without clothes"):
        register_folder(clothed, tmp_path, tmp_path / "out", same_person=True)
    with pytest.raises(ArgumentError, match="sequence and same_person"):
        register_folder(
            ScanRegistration(model), tmp_path, tmp_path, sequence=True, same_person=True
        )


def test_a_folder_is_registered_together_and_again_if_a_scan_is_new(
    model, scans, alone, together, tmp_path, monkeypatch
):
    registration, folder, output = ScanRegistration(model), tmp_path / "anna", tmp_path / "bodies"
    folder.mkdir()
    for name, scan in zip("ab", scans, strict=False):
        np.save(folder / f"{name}.npy", scan.points)
    (folder / "broken.xyz").write_text("1 2 3\n4 5\n")
    by_size = {len(result.scan): result for result in alone}
    calls = []

    def solve(self, scan, *, trace=False):
        calls.append(len(scan))
        return by_size[len(scan)]

    monkeypatch.setattr(ScanRegistration, "solve", solve)
    records = register_folder(registration, folder, output, same_person=True)
    assert [record.trusted for record in records] == [True, True, False]
    for record, result in zip(records, together, strict=False):
        np.testing.assert_allclose(record.arrays["points"], result.points, atol=1e-12)
    again = register_folder(registration, folder, output, same_person=True)
    assert [record.name for record in again] == ["a", "b", "broken"]
    assert len(calls) == 2
    (folder / "broken.xyz").unlink()
    for _ in range(2):
        register_folder(registration, folder, output, same_person=True)
    assert len(calls) == 4
