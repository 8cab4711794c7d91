"""Whether two bodies can be the same person: their distance compared with the open bodies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.checks import a_function, check_methods, checked, real_array
from riemhuman.datasets import load_open_bodies, load_open_model
from riemhuman.geometry import (
    AlignedSurfaces,
    AreaMetric,
    ElasticMetric,
    RiemannianMetric,
    RotationMetric,
    SRNFMetric,
)
from riemhuman.measurements.measurement_set import load_json
from riemhuman.surfaces import Template


@dataclass(frozen=True)
class UsualDistances:
    """Median distances of the open bodies under a metric.

    Attributes
    ----------
    one_person : float
        Of one person in two poses.
    two_people : float
        Of two people in one pose.

    Examples
    --------
    See `usual_distances`.
    """

    one_person: float
    two_people: float


@dataclass(frozen=True)
class PersonDistance:
    """The shape distance between two bodies, and typical distances.

    Attributes
    ----------
    distance : float
        Under `AreaMetric`, metres.
    usual : UsualDistances

    Examples
    --------
    See `person_distance`.
    """

    distance: float
    usual: UsualDistances

    @property
    def is_hardly_one_person(self) -> bool:
        """Whether the distance is nearer to that of two people than to that of one."""
        return self.distance > (self.usual.one_person + self.usual.two_people) / 2

    @property
    def text(self) -> str:
        """What to say about bodies that probably show two people, after "they are"."""
        return (
            "probably not the same person: their shape distance is "
            f"{self.distance:.2g} m; typical are {self.usual.one_person:.2g} m for one person in "
            f"two poses and {self.usual.two_people:.2g} m for two people (open bodies)"
        )


@checked(metric_of=a_function)
def usual_distances(metric_of: Callable[[Template], RiemannianMetric]) -> UsualDistances:
    """Return how far the coarse open bodies usually are from each other.

    The medians of the usual metrics are stored; those of other metrics are computed.

    Parameters
    ----------
    metric_of : callable
        Maps the template of the bodies to the metric.

    Examples
    --------
    >>> def shape_metric(template):
    ...     return rh.ElasticMetric(rh.AlignedSurfaces(template, scale=None), 1.0, 1e-4, 0.0)
    >>> usual = rh.measurements.usual_distances(shape_metric)
    >>> round(usual.one_person, 3)
    0.084
    """
    template = load_open_model("coarse").template
    metric = metric_of(template)
    check_methods(metric, "metric_of(template)", "a metric", "dist_pairwise")
    for name, known in usual_metrics(template).items():
        if type(metric) is type(known) and repr(metric) == repr(known):
            return UsualDistances(*load_json("usual_distances.json")[name])
    return usual_distances_of(metric)


def usual_metrics(template: Template) -> dict[str, RiemannianMetric]:
    """Return the metrics whose usual distances are stored, by name."""
    # See tutorials/remake/build_usual_distances.py.
    space = AlignedSurfaces(template, equip=False, scale=None)
    return {
        "shape": ElasticMetric(space, 1.0, 1e-4, 0.0),
        "pose": ElasticMetric(space, 0.0, 0.0, 1.0),
        "lengths": ElasticMetric(space, 1.0, 1.0, 0.0),
        "both": ElasticMetric(space, 1.0, 1.0, 0.1),
        "areas": AreaMetric(space),
        "srnf": SRNFMetric(space),
        "rotations": RotationMetric(space),
    }


def usual_distances_of(metric: RiemannianMetric) -> UsualDistances:
    """Return the medians of the distances of the coarse open bodies."""
    bodies = load_open_bodies("coarse")
    distances = metric.dist_pairwise(bodies.points)
    same_person = np.equal.outer(bodies.subject, bodies.subject)
    same_pose = np.equal.outer(bodies.pose, bodies.pose)
    return UsualDistances(
        one_person=float(np.median(distances[same_person & ~same_pose])),
        two_people=float(np.median(distances[same_pose & ~same_person])),
    )


def person_distance(before: ArrayLike, after: ArrayLike, faces: ArrayLike) -> PersonDistance:
    """Return how far apart two bodies with the same triangles are as people, in any poses.

    Parameters
    ----------
    before, after : array_like, shape (V, 3)
        Bodies, metres.
    faces : array_like of int, shape (F, 3)
        Their triangles.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> faces = bodies.template.faces
    >>> rh.measurements.person_distance(bodies[0], bodies[3], faces).is_hardly_one_person
    False
    >>> rh.measurements.person_distance(bodies[0], bodies[50], faces).is_hardly_one_person
    True
    """
    before = real_array(before, "before", ("n_vertices", 3), batched=False)
    after = real_array(after, "after", before.shape, batched=False)
    metric = _area_metric(Template(before, faces))
    return PersonDistance(float(metric.dist(before, after)), usual_distances(_area_metric))


def _area_metric(template: Template) -> AreaMetric:
    return AreaMetric(AlignedSurfaces(template, equip=False, scale=None))
