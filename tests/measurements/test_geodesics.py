"""Shortest paths against great circles, helices, and shortest paths over many more vertices."""

import numpy as np
import pytest
from known_surfaces import ellipsoid, set_at, tube
from scipy import sparse, special
from scipy.sparse.csgraph import dijkstra

from riemhuman.datasets import load_open_bodies
from riemhuman.errors import ArgumentError
from riemhuman.measurements import Length, Measurements, MeasurementSet
from riemhuman.surfaces.template import Template

PATH = Length(name="path", along=("start", "end"), path="surface")


def _length(template, start, end, points=None):
    measurements = Measurements(set_at(template, [PATH], start=start, end=end))
    return float(measurements.measure(template.vertices if points is None else points).values[0])


def test_great_circles_to_second_order():
    start, end = np.array([0.5, 0.3, 0.81]), np.array([-0.7, 0.6, 0.1])
    start, end = (0.3 * x / np.linalg.norm(x) for x in (start, end))
    truth = 0.3 * np.arccos(start @ end / 0.09)
    errors = [
        abs(_length(ellipsoid(n, (0.3, 0.3, 0.3)), start, end) / truth - 1) for n in (6, 12, 24)
    ]
    assert errors[-1] < 1e-3
    assert errors[0] / errors[-1] > 8


def test_helices():
    """From a point on an edge, whichever of its two triangles comes first."""
    start, end = [0.15, 0.2, 0.0], [0.15 * np.cos(2.0), 0.6, 0.15 * np.sin(2.0)]
    template = tube(60, 40)
    for faces in (template.faces, np.roll(template.faces, template.n_faces // 2, axis=0)):
        length = _length(Template(template.vertices, faces), start, end)
        np.testing.assert_allclose(length, np.hypot(0.15 * 2.0, 0.4), rtol=1e-3)


def _renumbered(template, rng):
    """The same surface: other numbers of vertices and triangles, and other first corners."""
    numbers = rng.permutation(template.n_vertices)
    vertices = np.empty_like(template.vertices)
    vertices[numbers] = template.vertices
    faces = numbers[rng.permutation(template.faces)]
    return Template(vertices, [np.roll(face, rng.integers(3)) for face in faces])


def test_any_order_of_triangles_and_vertices(open_body):
    """Between vertices, points on edges and middles of triangles."""
    rng = np.random.default_rng(0)
    kinds = np.array([[1, 0, 0], [0.4, 0.6, 0], [1 / 3, 1 / 3, 1 / 3]])
    for template in (tube(60, 40), ellipsoid(8, (0.3, 0.3, 0.3)), open_body):
        corners = template.vertices[template.faces[rng.integers(template.n_faces, size=6)]]
        places = dict(zip("abcdef", np.tile(kinds, (2, 1))[:, None] @ corners, strict=True))
        places = {name: place[0] for name, place in places.items()}
        paths = [Length(name=a + b, along=(a, b), path="surface") for a in "abc" for b in "def"]
        one, other = (
            Measurements(set_at(surface, paths, **places)).measure(surface.vertices).values
            for surface in (template, _renumbered(template, rng))
        )
        np.testing.assert_allclose(other, one, rtol=1e-9)


@pytest.fixture(scope="module")
def open_body():
    bodies = load_open_bodies("coarse", people=1)
    return Template(bodies.points[3], bodies.template.faces)


@pytest.mark.parametrize(("n_around", "n_along"), [(100, 20), (400, 20), (100, 100)])
def test_paths_that_are_rerouted_many_times(n_around, n_along):
    """From the bottom of an elliptic cylinder to the opposite point of its top."""
    template = tube(n_around, n_along, radius=1.0, length=1.0)
    template = Template(template.vertices * [0.2, 1.0, 0.1], template.faces)
    length = _length(template, [0.2, 0.0, 0.0], [-0.2, 1.0, 0.0])
    np.testing.assert_allclose(length, np.hypot(1.0, 0.2 * special.ellipe(0.75) * 2), rtol=3e-3)


def test_no_longer_than_ways_along_edges_of_bumpy_surfaces():
    rng = np.random.default_rng(8)
    template = ellipsoid(8)
    start, end = [0.05, 0.45, 0.03], [-0.05, -0.45, 0.02]
    measurements = Measurements(set_at(template, [PATH], start=start, end=end))
    places = measurements.definitions
    for _ in range(5):
        points = template.vertices * (1 + 0.02 * rng.normal(size=(len(template.vertices), 1)))
        length = float(measurements.measure(points).values[0])
        ends = [weights @ points[v] for v, weights in map(places.landmarks.get, ("start", "end"))]
        assert length >= np.linalg.norm(ends[0] - ends[1])
        a, b = template.edges.T
        graph = sparse.csr_array(
            (np.linalg.norm(points[a] - points[b], axis=1), (a, b)), shape=(len(points),) * 2
        )
        one, other = (places.landmarks[name][0] for name in ("start", "end"))
        around = dijkstra(graph, directed=False, indices=one)[:, other]
        hops = [
            np.linalg.norm(points[v] - e, axis=1) for v, e in zip((one, other), ends, strict=True)
        ]
        assert length <= (around + hops[0][:, None] + hops[1]).min() + 1e-12


def test_ends_on_different_surfaces():
    one = ellipsoid(3)
    both = np.concatenate([one.vertices, one.vertices + 1.0])
    template = Template(both, np.concatenate([one.faces, one.faces + one.n_vertices]))
    landmarks = {
        "start": (template.faces[0], np.full(3, 1 / 3)),
        "end": (template.faces[-1], np.full(3, 1 / 3)),
    }
    measurements = Measurements(MeasurementSet(template, [PATH], landmarks))
    with pytest.raises(ArgumentError, match="one connected component"):
        measurements.measure(template.vertices)


@pytest.mark.parametrize("defect", ["inverted triangles", "edges without length"])
def test_paths_across_defects_of_meshes_are_finite_or_missing(defect):
    rng = np.random.default_rng(1)
    template = ellipsoid(8)
    ends = {"start": [0.05, 0.45, 0.03], "end": [-0.05, -0.45, 0.02]}
    for _ in range(10):
        faces, points = template.faces.copy(), template.vertices.copy()
        if defect == "inverted triangles":
            some = rng.choice(len(faces), len(faces) // 5, replace=False)
            faces[some] = faces[some, ::-1]
        else:
            some = rng.choice(len(points), len(points) // 3, replace=False)
            points[some] = points[faces[rng.integers(len(faces)), 0]]
        places = set_at(Template(template.vertices, faces), [PATH], **ends)
        measured = Measurements(places).measure(points, missing="nan")
        assert np.isfinite(measured.values[0]) or measured.why_missing
