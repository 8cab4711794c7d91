"""Frames of triangles, and what takes one to another."""

import numpy as np
import pytest
from cases import TEMPLATES, sphere_template, surfaces

from riemhuman.kernels.surface import (
    deformation_gradients,
    partial_derivatives,
    polar_frames,
    stacked_derivatives,
    triangle_frames,
)


def test_frames_hold_derivatives_and_unit_normals():
    template = sphere_template()
    frames = triangle_frames(template.vertices, template.differential_operator)
    # On the template itself f_u, f_v and n are orthonormal.
    gram = np.swapaxes(frames, -1, -2) @ frames
    np.testing.assert_allclose(gram, np.eye(3) + np.zeros_like(gram), atol=1e-12)
    np.testing.assert_array_equal(
        stacked_derivatives(frames), template.differential_operator @ template.vertices
    )


def test_gradients_of_a_linear_map_are_the_map_along_the_surface():
    template = sphere_template()
    matrix = np.eye(3) + 0.3 * np.random.default_rng(0).standard_normal((3, 3))
    before, after = (
        triangle_frames(points, template.differential_operator)
        for points in (template.vertices, template.vertices @ matrix.T)
    )
    gradients = deformation_gradients(before, after)
    np.testing.assert_allclose((gradients @ before)[..., :2], (matrix @ before)[..., :2])
    np.testing.assert_allclose(gradients @ before, after, atol=1e-12)


@pytest.mark.parametrize("name", TEMPLATES)
def test_polar_frames_are_those_of_the_polar_decomposition(name):
    template = TEMPLATES[name]()
    f_u, f_v = partial_derivatives(surfaces(template, 2), template.differential_operator)
    frames = polar_frames(f_u, f_v)
    left, _, right = np.linalg.svd(np.stack([f_u, f_v], axis=-1), full_matrices=False)
    np.testing.assert_allclose(frames[..., :2], left @ right, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(frames), 1.0, rtol=1e-12)
