"""Bodies as turns and stretches of parts, and back."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from train_codes import find_parts

from riemhuman.surfaces.template import Template

N_ROUND, N_ALONG = 6, 13


def tube():
    """Return a closed tube along x."""
    angles = 2.0 * np.pi * np.arange(N_ROUND) / N_ROUND
    rings = [
        np.stack([np.full(N_ROUND, x), 0.1 * np.cos(angles), 0.1 * np.sin(angles)], axis=1)
        for x in np.linspace(0.0, 1.0, N_ALONG)
    ]
    vertices = np.concatenate([*rings, [[-0.03, 0.0, 0.0], [1.03, 0.0, 0.0]]])
    faces = []
    for ring in range(N_ALONG - 1):
        for i in range(N_ROUND):
            a, b = ring * N_ROUND + i, ring * N_ROUND + (i + 1) % N_ROUND
            faces += [[a, a + N_ROUND, b], [b, a + N_ROUND, b + N_ROUND]]
    end, last = N_ROUND * N_ALONG, N_ROUND * (N_ALONG - 1)
    for i in range(N_ROUND):
        j = (i + 1) % N_ROUND
        faces += [[end, i, j], [end + 1, last + j, last + i]]
    return Template(vertices, faces)


def bent(template, angles, width=1.0):
    """Return the tube bent about its middle."""
    surfaces = []
    for angle in angles:
        points = template.vertices * [1.0, width, width]
        share = np.clip((points[:, :1] - 0.45) / 0.1, 0.0, 1.0)
        hinge = np.array([0.5, 0.0, 0.0])
        turned = (points - hinge) @ Rotation.from_rotvec([0, 0, angle]).as_matrix().T + hinge
        surfaces.append((1.0 - share) * points + share * turned)
    return np.stack(surfaces)


@pytest.fixture(scope="module")
def template():
    return tube()


@pytest.fixture(scope="module")
def parts(template):
    angles = np.linspace(-1.5, 1.5, 9)
    bodies = np.concatenate([bent(template, angles, width) for width in (0.8, 1.0, 1.3)])
    return find_parts(template, bodies, 6, np.random.default_rng(0))


def test_template_neither_turns_nor_stretches(template, parts):
    features, frames = parts.split(template.vertices[None])
    np.testing.assert_allclose(features, 0.0, atol=1e-7)
    np.testing.assert_allclose(frames, np.eye(3)[None], atol=1e-7)


def test_bent_tubes_come_back(template, parts):
    bodies = bent(template, [-1.1, 0.3, 1.3], 1.1)
    features, frames = parts.split(bodies)
    wanted = (bodies - bodies.mean(axis=1, keepdims=True)) @ frames
    found = parts.surfaces(features)
    assert np.linalg.norm(found - wanted, axis=-1).mean() < 0.01
    # One hinge: without turning parts, the error is that of the straight tube.
    features[:, : 3 * parts.n_parts] = 0.0
    assert np.linalg.norm(parts.surfaces(features) - wanted, axis=-1).mean() > 0.05


def test_features_do_not_know_place_nor_heading(template, parts):
    bodies = bent(template, [0.7, -0.4])
    turn = Rotation.from_rotvec([0.4, -2.0, 0.9]).as_matrix()
    features, frames = parts.split(bodies)
    moved, moved_frames = parts.split(bodies @ turn.T + [3.0, -1.0, 0.2])
    np.testing.assert_allclose(moved, features, atol=1e-6)
    np.testing.assert_allclose(moved_frames, turn @ frames, atol=1e-6)


def test_width_is_a_stretch_and_bending_a_turn(template, parts):
    features, _ = parts.split(np.concatenate([bent(template, [0.0], 1.2), bent(template, [1.0])]))
    turns, stretches = np.split(features, [3 * parts.n_parts], axis=1)
    assert np.abs(turns[0]).max() < 1e-6 < 0.1 < np.abs(stretches[0]).max()
    assert np.abs(turns[1]).max() > 0.3
