"""The area projection transform: spheres, cylinders, a direct count, rigid motions, bad meshes."""

import numpy as np
import pytest
import trimesh
from known_surfaces import grid_faces, sphere
from scipy.spatial.transform import Rotation
from scipy.special import rel_entr

from riemhuman.descriptors import AreaProjectionTransform
from riemhuman.errors import ArgumentError, DegenerateSurfaceError


def blob():
    """Return a body without symmetry, of the size of a torso."""
    vertices, faces = sphere(3, radius=0.15)
    vertices = vertices * [1.0, 1.7, 0.7]
    vertices[:, 0] += 1.5 * vertices[:, 1] ** 2
    vertices[:, 2] += 0.3 * vertices[:, 0] * vertices[:, 1]
    return vertices, faces


def test_equals_a_direct_count():
    vertices, faces = sphere(1, 0.1)
    vertices = vertices * [1.0, 1.2, 0.9]
    radius, ratio, voxel = 0.06, 0.5, 0.004
    found = AreaProjectionTransform((radius,), voxel, ratio).transform(vertices, faces)
    # Points and interpolated normals by another rule: random barycentric coordinates.
    rng = np.random.default_rng(0)
    corners = vertices[faces]
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(vertices)
    np.add.at(normals, faces, crosses[:, None])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    weights = rng.dirichlet(np.ones(3), size=(len(faces), 2000))
    points = np.einsum("fsc,fcx->fsx", weights, corners)
    directions = np.einsum("fsc,fcx->fsx", weights, normals[faces])
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    arrived = (points - radius * directions).reshape(-1, 3)
    areas = np.repeat(np.linalg.norm(crosses, axis=1) / 2 / 2000, 2000)
    for place in ([0, 0, 0], [0.03, 0.01, -0.02], [0.0, 0.05, 0.0]):
        index = np.rint((np.array(place) - found.origin) / voxel).astype(int)
        center = found.origin + voxel * index
        near = np.linalg.norm(arrived - center, axis=1) < ratio * radius
        exact = areas[near].sum() / (4 * np.pi * radius**2)
        assert found.values[0][tuple(index)] == pytest.approx(exact, rel=0.05, abs=0.005)


def test_enclosed_voxels_of_solids():
    ring = trimesh.creation.torus(0.2, 0.07, major_sections=96, minor_sections=48)
    descriptor = AreaProjectionTransform((0.03,), voxel_size=0.011)
    for (vertices, faces), level in (
        (sphere(4, 0.2), lambda x: np.linalg.norm(x, axis=-1) - 0.2),
        (
            (ring.vertices, ring.faces),
            lambda x: np.hypot(np.linalg.norm(x[..., :2], axis=-1) - 0.2, x[..., 2]) - 0.07,
        ),
    ):
        found = descriptor.transform(vertices, faces)
        distance = level(found.centers)
        clear = np.abs(distance) > 0.002
        np.testing.assert_array_equal(found.inside[clear], distance[clear] < 0)


def test_rays_through_edges_and_corners_count_once():
    box = trimesh.creation.box(extents=(0.4, 0.4, 0.4))
    found = AreaProjectionTransform((0.18,), 0.1).transform(box.vertices, box.faces)
    # The corners of the box are centres of voxels.
    np.testing.assert_allclose(10 * found.centers, np.rint(10 * found.centers), atol=1e-9)
    strictly = (np.abs(found.centers) < 0.15).all(axis=-1)
    beyond = (np.abs(found.centers) > 0.25).any(axis=-1)
    assert found.inside[strictly].all()
    assert not found.inside[beyond].any()


def test_histograms_hardly_know_where_the_body_stands():
    vertices, faces = blob()
    descriptor = AreaProjectionTransform()
    turns = Rotation.random(4, rng=3).as_matrix()
    moved = [vertices @ turn.T + 1.234 for turn in turns] + [vertices + 0.0077]
    others = [vertices * 1.08, vertices * [1.15, 1.0, 1.0]]
    rows = descriptor.describe_all([(points, faces) for points in [vertices, *moved, *others]])
    distances = descriptor.distances(rows)
    same = slice(0, len(moved) + 1)
    assert distances[same, same].max() < 0.5 * distances[0, len(moved) + 1 :].min()
    whole_voxels = descriptor.describe(vertices + 10 * descriptor.voxel_size, faces)
    np.testing.assert_allclose(whole_voxels, rows[0], atol=1e-5)
    volume = trimesh.Trimesh(vertices, faces).volume
    np.testing.assert_allclose(rows[0].reshape(7, 24).sum(axis=1), volume, rtol=0.02)


def test_orientation_and_small_holes():
    vertices, faces = blob()
    descriptor = AreaProjectionTransform()
    whole = descriptor.describe(vertices, faces)
    np.testing.assert_allclose(descriptor.describe(vertices, faces[:, ::-1]), whole, atol=1e-12)
    punctured = descriptor.describe(vertices, np.delete(faces, [10, 400, 401], axis=0))
    swollen = descriptor.describe(1.08 * vertices, faces)
    distances = descriptor.distances([whole, punctured, swollen])
    assert distances[0, 1] < 0.3 * distances[0, 2]


def test_slivers_are_sampled_along():
    # A strip of needles across it has the transform of the same strip in few squares.
    def strip(n):
        x, y = np.meshgrid(np.linspace(0.0, 0.4, n), [0.0, 0.4])
        vertices = np.stack([x.ravel(), y.ravel(), 0.0 * x.ravel()], axis=1)
        return vertices, grid_faces(2, n)

    descriptor = AreaProjectionTransform((0.06,), voxel_size=0.01)
    needles, squares = (descriptor.transform(*strip(n)).values for n in (400, 3))
    np.testing.assert_allclose(needles, squares, atol=0.02 * squares.max())
    assert needles.sum() == pytest.approx(squares.sum(), rel=0.01)


def test_distances_of_histograms():
    rows = np.random.default_rng(1).dirichlet(np.ones(6), size=4)
    rows[0, :3] = 0.0
    rows[1, 2:] = 0.0
    found = AreaProjectionTransform().distances(rows)
    middle = (rows[:, None] + rows) / 2
    exact = (rel_entr(rows[:, None], middle) + rel_entr(rows[None], middle)).sum(axis=-1)
    np.testing.assert_allclose(found, exact, atol=1e-12)
    nearly_equal = np.concatenate([rows, np.nextafter(rows, 1.0)])
    assert AreaProjectionTransform().distances(nearly_equal).min() == 0.0


def test_meshes_it_cannot_take():
    descriptor = AreaProjectionTransform()
    vertices, faces = sphere(2, 0.1)
    with pytest.raises(ArgumentError, match="Is the mesh in metres"):
        descriptor.describe(20_000 * vertices, faces)
    with pytest.raises(DegenerateSurfaceError, match="encloses no voxel of side 0.02 m"):
        descriptor.describe(vertices, faces[:1])
    with pytest.raises(DegenerateSurfaceError, match="no triangle of the mesh has area"):
        descriptor.describe(0 * vertices, faces)
    with pytest.raises(ArgumentError, match="radii must be positive numbers"):
        AreaProjectionTransform(radii=(0.1, -0.1))
