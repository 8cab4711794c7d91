"""The checker of generated bodies sees what is there."""

import numpy as np
from cases import sphere_template
from self_intersections import count_self_intersections

TEMPLATE = sphere_template()


def test_two_crossing_triangles():
    one = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    through = np.array([[0.2, 0.2, -1], [0.3, 0.2, 1], [0.2, 0.3, 1]])
    faces = np.arange(6).reshape(2, 3)
    assert count_self_intersections(np.concatenate([one, through]), faces) == 1
    assert count_self_intersections(np.concatenate([through, one]), faces) == 1
    assert count_self_intersections(np.concatenate([one, through + [1, 0, 0]]), faces) == 0
    assert count_self_intersections(np.concatenate([one, through + [0, 0, 2]]), faces) == 0


def test_spheres():
    vertices, faces = TEMPLATE.vertices, TEMPLATE.faces
    both = np.concatenate([faces, faces + len(vertices)])
    for shift, least, most in ((0.4, 10, np.inf), (1.4, 0, 0)):
        two = np.concatenate([vertices, vertices + [shift, 0.0, 0.0]])
        assert least <= count_self_intersections(two, both) <= most
