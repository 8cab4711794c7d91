"""Measures of surfaces along paths."""

import numpy as np
import pytest
import trimesh
from cases import open_template, sphere_template, surfaces

from riemhuman.errors import ArgumentError
from riemhuman.surfaces.distortion import (
    change_along_path,
    edge_lengths,
    is_closed,
    signed_volume,
    summarize,
    triangle_areas,
)


def test_measures_agree_with_trimesh():
    template = sphere_template()
    points = surfaces(template, 3)
    areas = triangle_areas(points, template.faces)
    lengths = edge_lengths(points, template.edges)
    volumes = signed_volume(points, template.faces)
    for k in range(3):
        mesh = trimesh.Trimesh(points[k], template.faces, process=False)
        np.testing.assert_allclose(areas[k], mesh.area_faces, rtol=1e-12)
        np.testing.assert_allclose(volumes[k], mesh.volume, rtol=1e-12)
        np.testing.assert_allclose(np.sort(lengths[k]), np.sort(mesh.edges_unique_length))


def test_volume_does_not_depend_on_the_place():
    box = trimesh.creation.box([1.0, 2.0, 3.0])
    points, faces = np.asarray(box.vertices), np.asarray(box.faces)
    np.testing.assert_allclose(signed_volume(points, faces), 6.0, rtol=1e-14)
    np.testing.assert_allclose(signed_volume(points, faces[:, ::-1]), -6.0, rtol=1e-14)
    np.testing.assert_allclose(signed_volume(-points, faces), -6.0, rtol=1e-14)
    sphere = sphere_template()
    far = signed_volume(sphere.vertices + 1e4, sphere.faces)
    np.testing.assert_allclose(far, signed_volume(sphere.vertices, sphere.faces), rtol=1e-11)


def test_closed_meshes_are_told():
    faces = sphere_template().faces
    assert is_closed(faces)
    assert not is_closed(faces[1:])
    assert not is_closed(open_template().faces)
    flipped = faces.copy()
    flipped[0] = flipped[0, ::-1]
    assert not is_closed(flipped)
    assert np.isnan(signed_volume(open_template().vertices, open_template().faces))


def test_change_along_path():
    sizes = np.array([[1.0, 1.0, 1.0, 2.0, 3.0], [2.0, 3.0, 0.5, 1.5, 3.0], [2.0, 2.0, 2.0, 1, 3]])
    np.testing.assert_allclose(change_along_path(sizes), [0.0, 0.5, 1.0, 0.0, 0.0])
    np.testing.assert_allclose(change_along_path(sizes[::-1]), change_along_path(sizes))
    np.testing.assert_allclose(change_along_path(7.0 * sizes), change_along_path(sizes))


def test_growth_and_shrinkage_count_alike():
    grown, shrunk = (change_along_path(np.array([1.0, size, 1.0])) for size in (4.0, 0.25))
    assert grown == shrunk == 3.0


def test_change_with_sizes_of_zero():
    sizes = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 1.0], [1.0, 0.0, 0.0, 1.0]])
    np.testing.assert_array_equal(change_along_path(sizes), [np.inf, 0.0, np.inf, 0.0])


def test_summary():
    distortions = np.linspace(0.0, 1.0, 101)
    weights = np.where(distortions < 0.5, 0.0, 1.0)
    np.testing.assert_allclose(summarize(distortions, weights), (1.0, 0.99, 0.75))
    assert summarize(distortions, weights).quantile_99 == pytest.approx(0.99)


def test_bad_points_are_refused():
    faces = sphere_template().faces
    for measure in (triangle_areas, signed_volume, edge_lengths):
        with pytest.raises(ArgumentError, match="points must have shape"):
            measure(np.zeros((42, 2)), faces)
        with pytest.raises(ArgumentError, match="points holds 126 NaN"):
            measure(np.full((42, 3), np.nan), faces)
