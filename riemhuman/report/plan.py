"""The plan of a report: sizes of the experiments, weights of metrics, and names."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.report.retrieval_benchmark import POSE_METRIC, SHAPE_METRIC

if TYPE_CHECKING:
    from riemhuman.datasets import Bodies

SHAPE, POSE = SHAPE_METRIC, POSE_METRIC

# Weights (a, λ, c) of the paper's experiments.
POSE_WEIGHTS = (0.0, 0.0, 1.0)
PATH_WEIGHTS = (1.0, 1.0, 0.0)
BOTH_WEIGHTS = (1.0, 1.0, 0.1)


@dataclass(frozen=True)
class Plan:
    """Sizes of the experiments.

    Attributes
    ----------
    n_nodes : int
        Number of surfaces of each path.
    n_components : int
        Number of deformations of a basis that the report computes.
    sequences : tuple of str, optional
        Motions from which the basis is computed; by default all.
    lams : tuple of float
        Values of λ in the sweep.
    weights : tuple of float
        Values of c in the sweep, with a = 1.
    n_averaged : int
        Number of bodies of the Karcher mean.
    tolerance : float
        Tolerance of geodesics and means.
    seed : int
        Seed of all random numbers.
    """

    n_nodes: int = 11
    n_components: int = 100
    sequences: tuple[str, ...] | None = None
    lams: tuple[float, ...] = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0)
    weights: tuple[float, ...] = (0.0, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0)
    n_averaged: int = 5
    tolerance: float = 1e-5
    seed: int = 0


QUICK = Plan(
    n_nodes=7,
    n_components=40,
    sequences=("punching", "knees"),
    lams=(1e-4, 1e-2, 1.0),
    weights=(0.0, 1e-4, 1e-2, 1.0),
    tolerance=1e-4,
)


def elastic_metric(space: AlignedSurfaces, weights: tuple[float, float, float]) -> ElasticMetric:
    """Return a metric of the paper's family.

    Parameters
    ----------
    space : AlignedSurfaces
        The surfaces.
    weights : tuple of float
        (a, λ, c).

    Returns
    -------
    ElasticMetric
    """
    a, lam, c = weights
    return ElasticMetric(space, a=a, lam=lam, c=c)


def name_of(bodies: Bodies, index: int) -> str:
    """Return the names of the person and the pose of a body.

    Parameters
    ----------
    bodies : Bodies
        The bodies.
    index : int
        Number of the body.

    Returns
    -------
    str
    """
    subject = bodies.subject_names[bodies.subject[index]]
    pose = bodies.pose_names[bodies.pose[index]]
    return f"{spoken(subject)}, {spoken(pose)}"


def spoken(name: str) -> str:
    """Return a name as written in running text.

    Parameters
    ----------
    name : str
        Name of a class.

    Returns
    -------
    str

    Examples
    --------
    >>> from riemhuman.report.plan import spoken
    >>> spoken("t_like"), spoken("arms_up")
    ('T-like', 'arms up')
    """
    whole = re.sub(r"^([at])_(?=(like|pose)$)", lambda found: f"{found[1].upper()}-", name)
    return whole.replace("_", " ")
