"""The stages of a registration, as `ScanRegistration.solve` keeps them if asked to."""

from __future__ import annotations

from dataclasses import dataclass

from riemhuman.arrays import Array
from riemhuman.registration._arms_and_hands import ArmsFit
from riemhuman.registration._dense_fit import DenseFit
from riemhuman.registration._elastic_step import ElasticFit
from riemhuman.registration._start_search import Search
from riemhuman.registration._starts import Candidate
from riemhuman.registration._verdict import Verdict


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
    arms : ArmsFit
        The `pose` after other ways to hold forearms and hands were tried, and `doubtful_arms`.
    elastic : ElasticFit
        The last `pose`, its `model_points`, and `points`, the surface that left the model. If the
        scan does not show all limbs, it is that of the fit without those that are lost.
    verdict : Verdict
        What is trusted, and why not.
    up : array, shape (3,)
        The direction up, that of the start or a better one.
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
    arms: ArmsFit
    elastic: ElasticFit
    verdict: Verdict
    up: Array
    seconds: dict[str, float]

    def surfaces(self) -> dict[str, Array]:
        """Return the likeliest body after each stage, shape (V, 3), metres.

        The first is the start that led to it, the last the surface that left the model.
        """
        body, candidates = self.search.body, self.search.candidates
        return {
            "start": body.surface(self._first_start().pose),
            "search": body.surface(candidates[0].pose),
            "dense fit": body.surface(self.dense.pose),
            "arms and hands": body.surface(self.arms.pose),
            "elastic step": self.elastic.points,
        }

    def _first_start(self) -> Candidate:
        return self.search.starts[self.search.candidates[0].number]
