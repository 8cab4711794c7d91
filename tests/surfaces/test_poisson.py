"""Interpolation of deformation gradients, and its loops against polar decompositions."""

import numpy as np
import pytest
from cases import open_template, sphere_template, surfaces
from scipy.linalg import polar
from scipy.spatial.transform import Rotation

from riemhuman.surfaces import Template

TEMPLATES = {"sphere": sphere_template(), "open": open_template()}
TIMES = np.linspace(0.0, 1.0, 6)


def test_components_stay_where_the_straight_path_has_them():
    sphere = sphere_template()
    two = Template(
        np.concatenate([sphere.vertices, sphere.vertices + 5.0]),
        np.concatenate([sphere.faces, sphere.faces + sphere.n_vertices]),
    )
    end = two.vertices.copy()
    end[sphere.n_vertices :] += [0.0, 3.0, 0.0]
    middle = two.interpolator.interpolate(two.vertices, end, np.array([0.5]))[0]
    np.testing.assert_allclose(middle, 0.5 * (two.vertices + end), atol=1e-12)


def tube():
    """Return a slender cylinder along x with rings of vertices, x from 0 to 1."""
    n_rings, n_around = 30, 12
    x, angle = np.meshgrid(
        np.linspace(0, 1, n_rings),
        np.linspace(0, 2 * np.pi, n_around, endpoint=False),
        indexing="ij",
    )
    vertices = np.stack([x, 0.05 * np.cos(angle), 0.05 * np.sin(angle)], axis=-1).reshape(-1, 3)
    ring, step = np.meshgrid(np.arange(n_rings - 1), np.arange(n_around), indexing="ij")
    a, b = ring * n_around + step, ring * n_around + (step + 1) % n_around
    c, d = a + n_around, b + n_around
    faces = np.concatenate([np.stack([a, c, b], -1), np.stack([b, c, d], -1)]).reshape(-1, 3)
    return Template(vertices, faces)


def twisted(template, turn):
    """Return the tube with its cross-sections turned about its axis, by `turn` at the far end."""
    x = template.vertices[:, 0]
    vectors = (turn * x)[:, None] * [1.0, 0.0, 0.0]
    return Rotation.from_rotvec(vectors).apply(template.vertices.copy())


@pytest.mark.parametrize("turn", [0.7 * np.pi, 1.4 * np.pi, 1.6 * np.pi])
def test_neighbours_turn_alike_beyond_half_a_turn(turn):
    template = tube()
    interpolator = template.interpolator
    end = twisted(template, turn)
    turns = interpolator.rotations(template.vertices, end)
    assert np.linalg.norm(turns, axis=1).max() <= np.pi
    mended = interpolator.unwrap(turns)
    assert (mended is turns) == (turn < np.pi)
    assert interpolator.unwrap(mended) is mended
    np.testing.assert_allclose(
        Rotation.from_rotvec(mended).as_matrix(), Rotation.from_rotvec(turns).as_matrix(), atol=1e-9
    )
    angles = mended @ [1.0, 0.0, 0.0]
    assert angles.max() == pytest.approx(turn, rel=0.03)
    middle = interpolator.interpolate(template.vertices, end, np.array([0.5]), mended)[0]
    np.testing.assert_allclose(middle, twisted(template, turn / 2), atol=0.01)


@pytest.mark.parametrize("template", TEMPLATES.values(), ids=TEMPLATES)
def test_surface_of_derivatives_is_their_least_squares_fit(template):
    surface, other = surfaces(template, 2, rng=3)
    operator = template.differential_operator
    found = template.interpolator.surface_of(operator @ surface, placed_as=surface)
    np.testing.assert_allclose(found, surface, atol=1e-12)

    wanted = np.random.default_rng(4).standard_normal((2 * template.n_faces, 3))
    found = template.interpolator.surface_of(wanted, placed_as=other)
    weights = np.sqrt(np.tile(template.face_areas, 2))[:, None]
    expected, *_ = np.linalg.lstsq(weights * operator.toarray(), weights * wanted, rcond=1e-10)
    expected += other.mean(axis=0) - expected.mean(axis=0)
    np.testing.assert_allclose(found, expected, atol=1e-9)


def with_normals(template, points):
    """Return the matrices (f_u, f_v, n), shape (F, 3, 3)."""
    derivatives = (template.differential_operator @ points).reshape(2, -1, 3)
    normals = np.cross(*derivatives)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.stack([*derivatives, normals], axis=2)


@pytest.mark.parametrize("template", TEMPLATES.values(), ids=TEMPLATES)
@pytest.mark.parametrize(("size", "turned"), [(0.6, 1.0), (1e-3, 1e-3)], ids=["far", "near"])
def test_sources_by_polar_decomposition(template, size, turned):
    start, end = surfaces(template, 2, rng=4, size=size)
    turn = Rotation.from_rotvec(turned * np.array([0.5, 2.2, -0.4])).as_matrix()
    end = end @ turn.T
    times = np.array([0.0, 0.2, 0.5, 1.0])
    turns = template.interpolator.rotations(start, end)
    found = template.interpolator.rotated_sources(start, end, times, turns)
    first, last = with_normals(template, start), with_normals(template, end)
    wanted = np.zeros((len(times), 2, template.n_faces, 3))
    for t, (one, other) in enumerate(zip(first, last, strict=True)):
        rotation, _ = polar(other @ np.linalg.inv(one))
        vector = Rotation.from_matrix(rotation).as_rotvec()
        np.testing.assert_allclose(turns[t], vector, atol=1e-12)
        for i, share in enumerate(times):
            partway = Rotation.from_rotvec(share * vector).as_matrix()
            blend = (1 - share) * one + share * rotation.T @ other
            wanted[i, :, t] = (partway @ blend)[:, :2].T
    weights = np.tile(template.face_areas, 2)[:, None]
    for i, derivatives in enumerate(wanted):
        expected = template.differential_operator.T @ (weights * derivatives.reshape(-1, 3))
        np.testing.assert_allclose(found[:, i], expected, atol=1e-12)


def bands(n):
    """Return two bands around the z-axis, each of n triangles one after the other."""
    vertex, turn = np.arange(n), 2 * np.pi * np.arange(n) / n
    rim = np.stack([np.cos(turn), np.sin(turn), 0.1 * (vertex % 2)], axis=-1)
    faces = np.stack([vertex, (vertex + 1) % n, (vertex + 2) % n], axis=-1)
    faces[1::2] = faces[1::2, ::-1]  # so that neighbours run along their edge in opposite ways
    return Template(
        np.concatenate([rim, rim + [0.0, 0.0, 1.0]]), np.concatenate([faces, faces + n])
    )


@pytest.mark.parametrize("seed", range(2))
def test_rings_that_turn_once_around_are_cut_at_their_largest_steps(seed):
    """Two bands without an edge between them; their steps differ by less than a degree."""
    rng = np.random.default_rng(seed)
    n, axis = 100, np.array([0.36, -0.48, 0.8])
    steps = rng.uniform(0.9, 1.1, (2, n))
    steps *= 2 * np.pi / steps.sum(axis=1, keepdims=True)
    angles = np.cumsum(steps, axis=1) - steps
    interpolator = bands(n).interpolator
    turns = Rotation.from_rotvec(angles.reshape(-1, 1) * axis).as_rotvec()
    found = interpolator.unwrap(turns).reshape(2, n, 3)
    gaps = np.linalg.norm(np.roll(found, -1, axis=1) - found, axis=2)
    for ring, step in zip(gaps, steps, strict=True):
        # The last step leads from the last triangle back to the first.
        np.testing.assert_array_equal(np.flatnonzero(ring > 1.0), [np.argmax(step)])


def test_parts_come_by_their_area():
    template = open_template()
    highest, lowest = template.vertices[:, 1].argmax(), template.vertices[:, 1].argmin()
    chosen = np.any(template.faces == highest, axis=1)
    chosen[np.any(template.faces == lowest, axis=1).argmax()] = True
    parts = template.interpolator.parts(chosen)
    areas = [template.face_areas[part].sum() for part in parts]
    assert len(areas) == 2
    assert areas == sorted(areas, reverse=True)
    np.testing.assert_array_equal(np.sort(np.concatenate(parts)), np.flatnonzero(chosen))
