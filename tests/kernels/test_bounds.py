"""Compiled loops of kernels stay inside their arrays."""

import numpy as np
from cases import open_template, surfaces
from interpreted import check_bounds

from riemhuman.kernels import moving_frames, special_orthogonal, triangles, turns
from riemhuman.kernels.tiles import of_one_kind

TEMPLATE = open_template()
FACES, FRAMES, AREAS = TEMPLATE.faces, TEMPLATE.frame_coefficients, TEMPLATE.face_areas
FORMS = np.random.default_rng(0).standard_normal((len(FACES), 6, 6))
FORMS += np.swapaxes(FORMS, 1, 2)


def test_loops_over_single_surfaces(monkeypatch):
    start, end = surfaces(TEMPLATE, 2, rng=4, size=0.8)
    times = np.array([0.0, 0.3, 1.0])
    vectors = turns.triangle_turns(start, end, FACES)

    def blocks():
        added = np.zeros((len(FACES), 9, 9))
        triangles.add_blocks(added, start, FACES, FORMS)
        return [added]

    calls = [
        lambda: turns.triangle_turns(start, end, FACES),
        lambda: turns.turned_sources(start, end, vectors, times, FACES, FRAMES, AREAS),
        blocks,
    ]
    check_bounds(monkeypatch, [moving_frames, triangles, turns], calls)


def test_records_and_slopes(monkeypatch):
    path = of_one_kind(np.swapaxes(surfaces(TEMPLATE, 2, rng=7), 0, 1))
    slopes = np.random.default_rng(8).standard_normal((2, triangles.LENGTH, len(FACES)))

    def run():
        records, marked = np.empty_like(slopes), np.empty(len(FACES), dtype=bool)
        triangles.fill_records(path, FACES, FRAMES, 0, len(FACES), records)
        gradient = np.zeros(path.shape)
        triangles.add_gradient(records, slopes.copy(), FACES, FRAMES, 0, len(FACES), gradient)
        triangles.mark_degenerate(of_one_kind(path[:, 0]), FACES, FRAMES, marked)
        return [records, gradient, marked]

    check_bounds(monkeypatch, [triangles], [run])


def test_trees_of_turns(monkeypatch):
    rng = np.random.default_rng(5)
    quaternions = rng.standard_normal((6, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    vectors = rng.standard_normal((6, 3))
    # A ring of five, and one alone.
    ends = np.array([0, 2, 4, 6, 8, 10, 10])
    neighbours = np.array([1, 4, 0, 2, 1, 3, 2, 4, 3, 0])

    def unwrapped():
        found = 3.0 * vectors
        turns.unwrap_turns(found, quaternions, np.arange(6), ends, neighbours)
        return [found]

    check_bounds(monkeypatch, [turns], [unwrapped])


def test_nearest_rotations(monkeypatch):
    matrices = np.eye(3) + 0.1 * np.random.default_rng(6).standard_normal((4, 3, 3))
    calls = [lambda: [special_orthogonal.nearest_rotations(matrices)]]
    check_bounds(monkeypatch, [special_orthogonal], calls)
