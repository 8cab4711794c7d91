"""Polygons become triangles that cover them, whichever corner comes first."""

import numpy as np
import pytest

from riemhuman.errors import ArgumentError
from riemhuman.io.polygons import Polygons, is_split, split_polygons
from riemhuman.surfaces import triangle_areas


def split(places, *rings):
    rings = rings or (range(len(places)),)
    corners = np.concatenate([np.asarray(ring, dtype=np.int64) for ring in rings])
    return split_polygons(
        np.asarray(places, float), Polygons(corners, np.array([*map(len, rings)]))
    )


def signed_area(places):
    x, y = np.transpose(places)[:2]
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def flat(*corners):
    return np.array([[x, y, 0.0] for x, y in corners])


TURN = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
CONCAVE = {
    "a quad": flat((2, 0), (0.2, 0.2), (0, 2), (0, 0)),
    "an L, clockwise": flat((0, 2), (1, 2), (1, 1), (2, 1), (2, 0), (0, 0)),
    "an hourglass": flat((0, 0), (2, 0), (1.1, 1), (2, 2), (0, 2), (0.9, 1)),
    "straight angles": flat((0, 0), (1, 0), (2, 0), (2, 2), (1, 0.5), (0, 2), (0, 1)),
    "a slit": flat((0, 0), (4, 0), (4, 4), (1, 1), (0, 4), (1, 1)),
    "a hole": flat((0, 0), (3, 0), (3, 3), (0, 3), (0, 0), (1, 1), (1, 2), (2, 2), (2, 1), (1, 1)),
}


@pytest.mark.parametrize("name", CONCAVE)
def test_the_area_of_polygons_that_are_not_convex(name):
    turn = 0.01 * TURN
    expected = abs(signed_area(CONCAVE[name])) * abs(np.linalg.det(turn)) ** (2 / 3)
    places = CONCAVE[name] @ turn.T + 1.0
    n = len(places)
    for start in range(n):
        ring = np.roll(np.arange(n), start)
        faces = split(places, ring)
        assert len(faces) == n - 2
        normals = [signed_area(CONCAVE[name][face]) for face in faces]
        assert min(np.sign(signed_area(CONCAVE[name])) * np.array(normals)) >= 0.0
        assert triangle_areas(places, faces).sum() == pytest.approx(expected, rel=1e-9)
        assert is_split(faces, Polygons(ring, np.array([n])))


def test_bent_polygons_are_split_alike_from_every_corner():
    rng = np.random.default_rng(1)
    angles = np.linspace(0.0, 2.0 * np.pi, 7)[:-1]
    hexagon = np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    for name, places in {**CONCAVE, "a hexagon": hexagon}.items():
        bent = places + rng.normal(scale=0.02, size=places.shape)
        splits = {
            frozenset(
                tuple(np.roll(face, -face.argmin()))
                for face in split(bent, np.roll(np.arange(len(bent)), start))
            )
            for start in range(len(bent))
        }
        assert len(splits) == 1, name


def test_convex_polygons_are_split_from_their_first_corner():
    angles = np.linspace(0.0, 2.0 * np.pi, 7)[:-1]
    hexagon = np.stack([np.cos(angles), np.sin(angles), 0.5 * np.cos(angles)], axis=1)
    places = np.vstack([hexagon, CONCAVE["a quad"]])
    faces = split(places, [0, 1, 2], [2, 3, 4, 5, 0], [7, 8, 9, 6], [5, 3, 1, 0])
    expected = [[0, 1, 2], [2, 3, 4], [2, 4, 5], [2, 5, 0]]
    assert faces[:4].tolist() == expected
    assert {frozenset(face) for face in faces[4:6].tolist()} == {
        frozenset((6, 7, 9)),
        frozenset((7, 8, 9)),
    }
    assert faces[6:].tolist() == [[5, 3, 1], [5, 1, 0]]


def test_degenerate_polygons():
    places = flat((0, 0), (1, 0), (1, 1), (0, 1), (0.5, 0))
    assert split(places, [0, 1, 1, 2]).tolist() == [[0, 1, 2]]
    assert split(places, [2, 0, 1, 2, 2]).tolist() == [[2, 0, 1]]
    assert split(places, [0, 0, 0]).tolist() == [[0, 0, 0]]
    assert len(split(places, [0, 4, 1, 4])) == 2
    assert len(split(places * 0.0, [0, 1, 2, 3])) == 2
    assert split(places[:3], [0, 1, 2, 9]).tolist() == [[0, 1, 2], [0, 2, 9]]
    crossed = split(flat((0, 0), (2, 2), (2, 0), (0, 2), (-1, 1)))
    assert len(crossed) == 3
    assert split_polygons(places, Polygons(np.zeros(0, int), np.zeros(0, int))).shape == (0, 3)
    with pytest.raises(ArgumentError, match="1 of 3 have fewer, .*index 1 with 2"):
        split(places, [0, 1, 2], [0, 1], [0, 1, 2, 3, 4])


def test_splits_of_polygons_along_other_diagonals():
    polygons = Polygons(np.array([0, 1, 2, 3, 3, 2, 4]), np.array([4, 3]))
    assert is_split(np.array([[0, 1, 2], [0, 2, 3], [3, 2, 4]]), polygons)
    assert is_split(np.array([[1, 2, 3], [3, 0, 1], [3, 2, 4]]), polygons)
    for wrong in (
        [[0, 1, 2], [0, 2, 3], [3, 4, 2]],
        [[0, 1, 2], [0, 3, 2], [3, 2, 4]],
        [[0, 1, 2], [3, 2, 4], [0, 2, 3]],
        [[0, 1, 2], [0, 2, 3]],
    ):
        assert not is_split(np.array(wrong), polygons)
