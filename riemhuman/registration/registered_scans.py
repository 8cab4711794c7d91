"""Registered scans: surfaces of a body model or template at the places of scans; their stages."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from riemhuman.arrays import Array, Booleans, Triangles
from riemhuman.bodies import ModelFit
from riemhuman.provided import View, notebook_pictures
from riemhuman.registration._dense_fit import DenseFit, DenseTask
from riemhuman.registration._elastic_step import ElasticFit
from riemhuman.registration._start_search import Search
from riemhuman.registration._verdict import Verdict
from riemhuman.registration.scans import Scan
from riemhuman.surfaces.nearest_points import SurfacePoints


@dataclass(frozen=True, eq=False)
class RegistrationTrace:
    """The results of the stages that led to a registered scan, in order.

    Scans farther than 100 m from the origin are moved close to it, and so are all positions here.

    Attributes
    ----------
    search : Search
        `scan`, the prepared one with its `points`, `normals`, `up` and `floor`; `starts`, all
        candidates at their start; `rounds`, the candidates that each round kept; `candidates`,
        those of the last round, the likeliest first. A candidate has a `pose` and a `likelihood`.
    dense : DenseFit
        The `pose` after closest points, with arms and legs that cross exchanged where that fits
        better.
    arms : DenseFit
        The `pose` after other ways to hold forearms and hands were tried, and `arm_fits`.
    elastic : ElasticFit
        The last `pose`, its `model_points`, and `points`, the surface that left the model. If the
        scan does not show all limbs, it is that of the fit without those that are lost.
    verdict : Verdict
        What is trusted, and why not.
    up : array, shape (3,)
        The direction up, that of the start or a better one.
    task : DenseTask
        What the last fit knew: the scan, the prior, and the vertices that the scan can show.
    seconds : dict of str to float
        The time that each stage took.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> registration = rh.registration.ScanRegistration(bodies.model, up="y")
    >>> scan = rh.registration.simulated_scan(bodies[0], bodies.template.faces, rng=0)
    >>> trace = registration.solve(scan.points, trace=True).trace  # doctest: +SKIP
    >>> trace.surfaces()["dense fit"].shape  # doctest: +SKIP
    (1202, 3)
    """

    search: Search
    dense: DenseFit
    arms: DenseFit
    elastic: ElasticFit
    verdict: Verdict
    up: Array
    task: DenseTask
    seconds: dict[str, float]

    def surfaces(self) -> dict[str, Array]:
        """Return the likeliest body after each stage, shape (V, 3), metres.

        The first is the start that led to it, the last the surface that left the model.
        """
        body, candidates = self.search.body, self.search.candidates
        start = self.search.starts[candidates[0].number]
        return {
            "start": body.surface(start.pose),
            "search": body.surface(candidates[0].pose),
            "dense fit": body.surface(self.dense.pose),
            "arms and hands": body.surface(self.arms.pose),
            "elastic step": self.elastic.points,
        }


@dataclass(frozen=True, eq=False)
class RegisteredScan:
    """A registered scan, and whether to trust it.

    Attributes
    ----------
    points : array, shape (V, 3)
        The registered surface in the position of the scan, metres.
    trusted : bool
        Whether the body passed all checks. It is trusted even if another pose explains a hand
        almost as well; `trusted_vertices` then excludes the hand, and the message names it.
    trusted_vertices : array of bool, shape (V,)
        Vertices that the scan shows, or that are within 6 cm of these along the surface and not
        more than 1.5 cm outside what it shows, as straight fingers of a fist are. False for limbs
        in doubt: a forearm or the head turned differently, another pose of a hand, or exchanged
        arms fit the scan almost as well; no pose of a hand fits; or hands hide each other's
        fingers. False also for vertices beneath loose clothes, if the scan was said to show them
        (`ScanRegistration.clothed`). If the body is not trusted, all are False, unless only a limb
        is in doubt.
    message : str
        The checks that failed, limbs in doubt, and parts that the scan does not show.
    likelihood : float
        Mean log-likelihood of the scan points, normalised to a body of 1.8 square metres; NaN
        without a model.
    fit : ModelFit or None
        Betas, pose, trans and hands of the model, and the distances of `points` from it.
    distances : array, shape (N,)
        Distance of each point of the scan from the registered surface, metres.
    matched : array of bool, shape (V,)
        Vertices within 2 cm of matching points of the scan; the positions of the others follow from
        the model and the elastic metric.
    correspondence : SurfacePoints
        The nearest point on the surface for each point of the scan.
    background : array of bool, shape (N,)
        Points of the scan classified as floor, strays or hair.
    up : array, shape (3,)
        The direction up in the scan.
    transform : array, shape (4, 4)
        The rigid motion from the axes of the scan, in metres, to upright axes: y up, the body
        facing z and standing on the ground at the origin. The identity without a model.
    unit : str
        The unit of the scan.
    faces : array of int, shape (F, 3)
        Triangles of the registered surface.
    scan : Scan
        The scan, metres.
    trace : RegistrationTrace or None
        The results of all stages, if they were requested.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> registration = rh.registration.TemplateRegistration(bodies.template)
    >>> result = registration.solve((bodies[0], bodies.template.faces), start=bodies[0])
    >>> result.trusted, result.points.shape
    (True, (1202, 3))
    """

    points: Array
    trusted: bool
    trusted_vertices: Booleans
    message: str
    likelihood: float
    fit: ModelFit | None
    distances: Array
    matched: Booleans
    correspondence: SurfacePoints
    background: Booleans
    up: Array
    transform: Array
    unit: str
    faces: Triangles
    scan: Scan
    trace: RegistrationTrace | None = None

    @property
    def upright_points(self) -> Array:
        """The registered surface in upright axes, facing z, on the ground; shape (V, 3), metres."""
        return apply_transform(self.transform, self.points)

    def view(self) -> View:
        """Return a page with the scan over the body, see `riemhuman.plots.view_scan`.

        A notebook shows it; ``.save("x.html")`` writes it.
        """
        return notebook_pictures().view(self)

    def __repr__(self) -> str:
        share = 100.0 * self.matched.mean()
        body = self.distances[~self.background]
        return (
            f"<RegisteredScan: {'trusted' if self.trusted else 'not trusted'}, "
            f"{1000.0 * np.median(body):.1f} mm median distance, {share:.0f} % of the vertices "
            f"matched{'; ' + self.message if self.message else ''}>"
        )


def apply_transform(transform: Array, points: Array) -> Array:
    """Return points, shape (n, 3), after a rigid motion, shape (4, 4)."""
    moved: Array = points @ transform[:3, :3].T + transform[:3, 3]
    return moved
