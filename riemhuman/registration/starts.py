"""The search over headings, start poses and up directions, which drops unlikely starts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from riemhuman.bodies import BodyModel
from riemhuman.bodies.joint_motions import Skeleton
from riemhuman.kernels.threads import mapped
from riemhuman.registration.annealing import annealed
from riemhuman.registration.arms import arms_of, other_arms
from riemhuman.registration.model_samples import ModelSamples, sample_model
from riemhuman.registration.posing import Pose, posed, rotation
from riemhuman.registration.posing_equations import Prior
from riemhuman.registration.start_poses import FEW, joint_precisions, start_poses
from riemhuman.registration.surface_points import thinned

_AXES = np.concatenate([np.eye(3), -np.eye(3)])
_UP = np.array([0.0, 1.0, 0.0])
_N_HEADINGS = 6

# What the likelihood gains where another arm is right, and more than it differs between fits.
_ARM_GAIN = 0.02

N_THREADS = 2
"""Bodies that are fitted at once."""


@dataclass(frozen=True)
class Round:
    """One round of the search.

    Attributes
    ----------
    n_model, n_scan : int
        Number of points of the body and of the scan.
    sigmas : tuple of float
        First and last standard deviation, metres.
    n_steps : int
        Number of steps.
    n_best : int
        Number of candidates that are kept.
    """

    n_model: int
    n_scan: int
    sigmas: tuple[float, float]
    n_steps: int
    n_best: int


ROUNDS = (
    Round(250, 400, (0.20, 0.09), 5, 24),
    Round(500, 800, (0.09, 0.04), 6, 6),
    Round(1000, 1500, (0.04, 0.015), 9, 3),
)
"""The rounds for a scan without a known start."""

ARM_ROUNDS = (Round(250, 400, (0.12, 0.05), 5, 4), Round(1000, 1500, (0.04, 0.015), 5, 1))
"""The rounds for a body with another arm."""

WARM_ROUNDS = (Round(500, 800, (0.08, 0.04), 5, 1), Round(1000, 1500, (0.03, 0.015), 4, 1))
"""The rounds from a known start."""


@dataclass(frozen=True)
class Candidate:
    """A body fitted from one start.

    Attributes
    ----------
    pose : Pose
        Its parameters.
    prior : Prior
        The prior of the fit.
    likelihood : float
        Mean log-likelihood of the scan points in the last round.
    up : array, shape (3,)
        The direction up of its start.
    """

    pose: Pose
    prior: Prior
    likelihood: float
    up: np.ndarray


class StartSearch:
    """The search over starts for one body model.

    Parameters
    ----------
    model : BodyModel
        The model.
    """

    def __init__(self, model: BodyModel) -> None:
        self.model = model
        self.skeleton = Skeleton(model)
        self._samples: dict[int | None, ModelSamples] = {}

    def samples(self, n_samples: int | None) -> ModelSamples:
        """Return points of the model, which are computed once.

        Parameters
        ----------
        n_samples : int or None
            Approximate number of points; None for all.
        """
        if n_samples not in self._samples:
            self._samples[n_samples] = sample_model(self.model, n_samples, self.skeleton)
        return self._samples[n_samples]

    @cached_property
    def poses(self) -> dict[str, np.ndarray]:
        """The start poses."""
        return start_poses(self.model)

    @cached_property
    def precisions(self) -> np.ndarray:
        """Inverse variances of the joints' turns from a start pose."""
        return joint_precisions(self.model)

    def run(
        self,
        points: np.ndarray,
        normals: np.ndarray,
        *,
        up: np.ndarray | None,
        signed: bool,
        landmarks: dict[int, np.ndarray],
    ) -> list[Candidate]:
        """Return the bodies from the likeliest starts, the best first.

        Each arm of the best has been tried as all start poses hold it.

        Parameters
        ----------
        points, normals : array, shape (m, 3)
            Evenly spread points of the scan, metres, and unit normals.
        up : array, shape (3,), or None
            The direction up; None to try all axes.
        signed : bool
            Whether the signs of the normals are known.
        landmarks : dict of int to array, shape (3,)
            Known positions of joints.
        """
        centre = points.mean(axis=0)
        first, *others = ROUNDS
        ups = _AXES if up is None else up[np.newaxis]
        if up is None:
            few = [name for name in FEW if name in self.poses] or list(self.poses)
            starts = [c for way in ups for c in self._starts(few, way, centre)]
            found = self._advanced(starts, first, points, normals, signed, landmarks)
            best = {tuple(each.up): each.likelihood for each in reversed(found)}
            ways = sorted(best, key=lambda way: -best[way])
            ups = np.array([way for way in ways[:2] if best[way] > best[ways[0]] - 0.15])
        starts = [c for way in ups for c in self._starts(list(self.poses), way, centre)]
        found = self._advanced(starts, first, points, normals, signed, landmarks)
        for each in others:
            found = self._advanced(found, each, points, normals, signed, landmarks)
        likeliest = found[0]
        for arm in arms_of(self.model):
            likeliest = self._with_likeliest_arm(likeliest, arm, points, normals, signed, landmarks)
        # Rivals still have the arms they had, so that likelihoods compare as they were.
        return [replace(likeliest, likelihood=found[0].likelihood), *found[1:]]

    def run_from(
        self,
        pose: Pose,
        up: np.ndarray,
        points: np.ndarray,
        normals: np.ndarray,
        *,
        signed: bool,
        landmarks: dict[int, np.ndarray],
    ) -> Candidate:
        """Return the body from one known start.

        Parameters
        ----------
        pose : Pose
            The start, the body a moment before.
        up : array, shape (3,)
            The direction up of the start.
        points, normals, signed, landmarks
            As for `run`.
        """
        found = [Candidate(pose, Prior(pose.local, self.precisions, pose.betas, 4.0), -np.inf, up)]
        for each in WARM_ROUNDS:
            found = self._advanced(found, each, points, normals, signed, landmarks)
        return found[0]

    def likelihood(self, pose: Pose, points: np.ndarray, normals: np.ndarray) -> float:
        """Return the mean log-likelihood of a scan with the last deviation of the last round.

        Parameters
        ----------
        pose : Pose
            Parameters of a body.
        points, normals : array, shape (m, 3)
            Evenly spread points of the scan, metres, and unit normals.
        """
        last = ROUNDS[-1]
        prior = Prior(pose.local, self.precisions, pose.betas, 1.0)
        each = Round(last.n_model, last.n_scan, (last.sigmas[1], last.sigmas[1]), 0, 1)
        up = np.zeros(3)
        candidate = Candidate(pose, prior, -np.inf, up)
        return self._advanced([candidate], each, points, normals, True, {})[0].likelihood

    def _starts(self, names: list[str], up: np.ndarray, centre: np.ndarray) -> list[Candidate]:
        body = self.samples(ROUNDS[0].n_model)
        root = int(np.flatnonzero(self.model.parents < 0)[0])
        upright = _turn_between(_UP, up)
        betas = np.zeros(self.model.n_betas)
        starts = []
        for name in names:
            for angle in np.arange(_N_HEADINGS) * (2.0 * np.pi / _N_HEADINGS):
                local = self.poses[name].copy()
                local[root] = upright @ rotation(angle * _UP) @ local[root]
                pose = Pose(local, betas, np.zeros(3))
                shift = centre - body.areas @ posed(body, pose)[0]
                prior = Prior(self.poses[name], self.precisions, betas, 1.0)
                starts.append(Candidate(Pose(local, betas, shift), prior, -np.inf, up))
        return starts

    def _with_likeliest_arm(
        self,
        body: Candidate,
        arm: np.ndarray,
        points: np.ndarray,
        normals: np.ndarray,
        signed: bool,
        landmarks: dict[int, np.ndarray],
    ) -> Candidate:
        """Return a body with one arm as a start pose holds it if that is likelier, or as it is."""
        first, last = ARM_ROUNDS
        others = []
        for turns in other_arms(arm, body.prior.local, self.poses):
            local, expected = body.pose.local.copy(), body.prior.local.copy()
            local[arm] = expected[arm] = turns
            pose, prior = body.pose._replace(local=local), body.prior._replace(local=expected)
            others.append(replace(body, pose=pose, prior=prior))
        others = self._advanced(others, first, points, normals, signed, landmarks)
        (other,) = self._advanced(others, last, points, normals, signed, landmarks)
        (own,) = self._advanced([body], last, points, normals, signed, landmarks)
        return other if other.likelihood > own.likelihood + _ARM_GAIN else body

    def _advanced(
        self,
        candidates: list[Candidate],
        each: Round,
        points: np.ndarray,
        normals: np.ndarray,
        signed: bool,
        landmarks: dict[int, np.ndarray],
    ) -> list[Candidate]:
        body = self.samples(each.n_model)
        chosen = thinned(points, each.n_scan, np.random.default_rng(0))
        scan = points[chosen].astype(np.float32)
        scan_normals = normals[chosen].astype(np.float32)
        known = np.full((len(body.areas), 3), np.nan)
        n_vertices = len(body.areas) - self.model.n_joints
        for joint, place in landmarks.items():
            known[n_vertices + joint] = place
        # The likelihood is that before the last step, so one more step is needed.
        sigmas = np.append(np.geomspace(*each.sigmas, each.n_steps), each.sigmas[1])

        def advance(candidate: Candidate) -> Candidate:
            pose, likelihood = annealed(
                body, candidate.pose, candidate.prior, scan, scan_normals, sigmas, signed, known
            )
            return Candidate(pose, candidate.prior, likelihood, candidate.up)

        found = list(mapped(advance, candidates, N_THREADS))
        found.sort(key=lambda candidate: -candidate.likelihood)
        return _different(found, body)[: each.n_best]


def _different(candidates: list[Candidate], body: ModelSamples) -> list[Candidate]:
    """Return candidates without those that are close to a better one."""
    kept: list[Candidate] = []
    places: list[np.ndarray] = []
    for candidate in candidates:
        points = posed(body, candidate.pose)[0]
        if all(np.sqrt(np.mean((points - other) ** 2) * 3) > 0.03 for other in places):
            kept.append(candidate)
            places.append(points)
    return kept


def _turn_between(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the shortest rotation from one unit vector to another."""
    axis = np.cross(start, end)
    sine, cosine = np.linalg.norm(axis), start @ end
    if sine < 1e-9:
        return np.eye(3) if cosine > 0 else np.diag([1.0, -1.0, -1.0])
    vector: np.ndarray = axis * (np.arctan2(sine, cosine) / sine)
    return rotation(vector)
