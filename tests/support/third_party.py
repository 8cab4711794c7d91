"""What another package brings: a metric, descriptor, reader and measurement, by public names."""

import autograd.numpy as anp
import numpy as np

import riemhuman as rh


class VertexOffsets(rh.RiemannianMetric):
    """Displacements of the vertices, weighted by the area around each."""

    def squared_dist(self, point_a, point_b):
        """Return Σ_v A_v ‖a_v − b_v‖²."""
        areas = self.space.template.vertex_areas[:, None]
        return anp.sum(areas * (point_a - point_b) ** 2, axis=(-2, -1))


class Extents:
    """Width, height and depth: a descriptor by its methods alone."""

    def describe(self, vertices, faces):
        """Return the size of the box around a surface."""
        return np.ptp(vertices, axis=0)

    def distances(self, vectors):
        """Return the largest differences."""
        return np.abs(vectors[:, None] - vectors[None]).max(axis=-1)


class Crowd:
    """Surfaces with labels: a data set by its attributes alone."""

    def __init__(self, bodies):
        self.points, self.template = bodies.points, bodies.template
        self.subject, self.pose = bodies.subject.tolist(), None
        self.size = len(bodies)

    def __len__(self):
        return self.size


def read_crowd(path):
    """Return some of the open bodies; the path says how many."""
    return Crowd(rh.datasets.load_open_bodies("coarse")[: int(path)])


def area_of_the_head():
    """Return a measurement beside those of the library."""
    return rh.measurements.Area(name="area of the head", parts=("head",))
