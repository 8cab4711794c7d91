"""Bodies turned as others stand: what is exact, and what of the other comes along."""

import bodies_in_motion as bodies
import numpy as np
import pytest
from cases import deformations, sphere_template
from scipy.spatial.transform import Rotation

from riemhuman.errors import ArgumentError
from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
from riemhuman.geometry.elastic_metric import ElasticMetric
from riemhuman.solvers.smooth_turn import SmoothTurn
from riemhuman.surfaces.template import Template


@pytest.fixture(scope="module")
def space():
    """Return the surfaces over a deformed sphere."""
    return AlignedSurfaces(sphere_template(), equip=False)


@pytest.mark.parametrize("n_rounds", [0, 1, 3])
def test_a_rotation_is_exact(space, n_rounds):
    body = space.template.vertices + deformations(space.template, 1, rng=4, size=0.3)[0]
    turned = body @ Rotation.from_rotvec([0.5, -0.8, 0.3]).as_matrix() + [1.0, 0.0, 2.0]
    np.testing.assert_allclose(
        SmoothTurn(space, n_rounds=n_rounds).solve(body, turned), turned, atol=1e-10
    )


def test_size_is_no_pose(space):
    body = space.template.vertices + deformations(space.template, 1, rng=4, size=0.3)[0]
    found = SmoothTurn(space).solve(body, 1.3 * body)
    np.testing.assert_allclose(found, body + 0.3 * body.mean(axis=0), atol=1e-10)


def test_units_make_no_difference(space):
    """The time of the flow and the weights of joints are shares of the template's size."""
    first, second = space.template.vertices + deformations(space.template, 2, rng=6, size=0.3)
    template = type(space.template)(1000.0 * space.template.vertices, space.template.faces)
    scaled = AlignedSurfaces(template, equip=False)
    np.testing.assert_allclose(
        SmoothTurn(scaled).solve(1000.0 * first, 1000.0 * second),
        1000.0 * SmoothTurn(space).solve(first, second),
        rtol=1e-8,
    )


def test_waves_of_the_skin_stay_with_their_owner():
    """Ripples on the body of the pose turn its normals, and hardly those of the result."""
    shape, pose = bodies.body("resting"), bodies.body("arm raised")
    ripples = 0.004 * np.sin(2 * np.pi * bodies.model().template.vertices / 0.12)
    turn, normals = SmoothTurn(bodies.space()), ElasticMetric(bodies.space(), 0.0, 0.0, 1.0)
    smooth, rippled = (turn.solve(shape, pose + wave) for wave in (0.0, ripples))
    assert normals.dist(smooth, rippled) < 0.35 * normals.dist(pose, pose + ripples)


def test_bends_of_joints_come_back():
    """By rounds, and as heat hardly flows across joints: where it did, the knee was 10.7 mm off."""
    shape, pose = bodies.body("resting"), bodies.body("knee raised")

    def error(n_rounds):
        gap = SmoothTurn(bodies.space(), n_rounds=n_rounds).solve(shape, pose) - pose
        return np.linalg.norm(gap - gap.mean(axis=0), axis=1).mean()

    assert error(1) < min(0.7 * error(0), 0.006)


def test_the_trust_of_bends_is_that_of_strained_skin():
    """A limb of radius r that bends by κ strains its skin by rκ, beside a spread of σ."""
    x, y = np.meshgrid(np.linspace(0.0, 1.0, 41), np.linspace(0.0, 0.5, 21), indexing="ij")
    corner = np.arange(40 * 20).reshape(40, 20) + np.arange(40)[:, None]
    halves = [[corner, corner + 21, corner + 22], [corner, corner + 22, corner + 1]]
    faces = np.concatenate([np.stack(half, axis=-1).reshape(-1, 3) for half in halves])
    vertices = np.stack([x.ravel(), y.ravel(), 0.0 * x.ravel()], axis=-1)
    template = Template(vertices, faces)
    centres = vertices[faces].mean(axis=1)
    inside = np.all((centres > 0.1) & (centres < [0.9, 0.4, 1.0]) | (centres == 0.0), axis=1)
    for bend in (1.0, 3.0):
        field = Rotation.from_rotvec(np.outer(bend * centres[:, 0], [0.6, 0.0, 0.8])).as_matrix()
        found = SmoothTurn(AlignedSurfaces(template, equip=False))._trust(field)
        ratio = 0.05 / (0.1 * np.sqrt(1.8))  # r/σ, as a share of √area
        expected = 1.0 / (1.0 + ratio**2 * 0.5 * bend**2)
        # By finite volumes on right triangles, squared bends are a seventh too large.
        np.testing.assert_allclose(found[inside].mean(), expected, rtol=0.06)


def test_the_second_flow_takes_three_times_as_long(space, monkeypatch):
    heat, times = space.template.heat, []
    first, second = heat.step, heat.step_through
    monkeypatch.setattr(heat, "step", lambda t: times.append(t) or first(t))
    monkeypatch.setattr(heat, "step_through", lambda k, t: times.append(t) or second(k, t))
    body = space.template.vertices
    SmoothTurn(space, smoothing=0.01).solve(body, body)
    # Of two implicit steps each.
    area = space.template.face_areas.sum()
    np.testing.assert_allclose(times, [0.005 * area, 0.015 * area])


def test_bad_input(space):
    with pytest.raises(ArgumentError, match="smoothing must be"):
        SmoothTurn(space, 0.0)
    with pytest.raises(ArgumentError, match="n_rounds must be"):
        SmoothTurn(space, n_rounds=-1)
