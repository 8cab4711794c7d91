"""The search over headings, start poses and up directions, which drops unlikely starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from riemhuman.bodies import BodyModel, rotation_matrix
from riemhuman.kernels.threads import mapped
from riemhuman.registration._posed_body import (
    End,
    ModelSamples,
    Pose,
    Prior,
    anneal,
    pose_body,
    sample_model,
)
from riemhuman.registration._scan_preparation import N_THREADS, PreparedScan
from riemhuman.registration._start_poses import (
    UP_POSES,
    BodyParts,
    joint_precisions,
    other_arms,
    start_poses,
)

_AXES = np.concatenate([np.eye(3), -np.eye(3)])
_UP = np.array([0.0, 1.0, 0.0])
_N_HEADINGS = 6
# Steps by which the visible part of a start comes to the centre of the scan.
_N_SHIFTS = 8
# A direction up is tried fully if its likelihood is at most this much below the best.
_UP_MARGIN = 0.15
# Candidates nearer to a better one, in root mean square distance, are dropped.
_SAME_METRES = 0.03
# What the likelihood gains where another arm is right, and more than it differs between fits.
_ARM_GAIN = 0.02
# Inverse variance of the shape coefficients for a scan of the same person a moment later.
_WARM_BETAS_PRECISION = 4.0
# Inverse variance of the coefficients of hands that do not move.
_STILL_HANDS = 1e6


@dataclass(frozen=True)
class Round:
    """One round of the search: sizes, first and last standard deviation (metres), steps."""

    n_model: int  # points of the body
    n_scan: int  # points of the scan
    sigmas: tuple[float, float]
    n_steps: int
    n_best: int  # candidates to keep


# The first two are one schedule, in which unlikely starts are dropped early.
_ROUNDS = (
    Round(250, 400, (0.20, 0.164), 2, 96),
    Round(250, 400, (0.134, 0.09), 3, 24),
    Round(500, 800, (0.09, 0.04), 6, 6),
    Round(1000, 1500, (0.04, 0.015), 9, 3),
)
# The rounds for a body with another arm, and from a known start.
_ARM_ROUNDS = (Round(250, 400, (0.12, 0.05), 5, 4), Round(1000, 1500, (0.04, 0.015), 5, 1))
_WARM_ROUNDS = (Round(500, 800, (0.08, 0.04), 5, 1), Round(1000, 1500, (0.03, 0.015), 4, 1))
# The round after all others, of the model at nearly full resolution.
_FINE_ROUND = Round(3000, 5000, (0.015, 0.006), 5, 1)


@dataclass(frozen=True)
class Candidate:
    """A body fitted from one start."""

    pose: Pose
    prior: Prior
    likelihood: float  # mean log-likelihood of the scan points in the last round
    up: np.ndarray  # direction up of its start
    known: bool = False  # whether it started from the body a moment before


class StartSearch:
    """The search over starts for one body model, without legs (`cut` is -1) or all above (1)."""

    def __init__(self, model: BodyModel, cut: int = 0) -> None:
        self.model, self.cut, self.parts = model, cut, BodyParts(model)
        self.root = int(np.flatnonzero(model.parents < 0)[0])
        self.arms = self.parts.arms
        self._shown = ~self.parts.halves[0] if cut < 0 else np.ones(model.n_vertices, dtype=bool)
        self._samples: dict[int | None, ModelSamples] = {}
        self.poses = start_poses(model)
        self.precisions = joint_precisions(model)
        # Hands stay relaxed until the dense fit.
        n_hands = model.hand_directions.shape[2]
        self.betas_precisions = np.repeat([1.0, _STILL_HANDS], [model.n_betas, n_hands])

    def samples(self, n_samples: int | None) -> ModelSamples:
        """Return about this number of points of the model, all by None; computed once."""
        if n_samples not in self._samples:
            samples = sample_model(self.model, n_samples)
            areas = samples.areas * self._shown[samples.numbers]
            self._samples[n_samples] = samples._replace(areas=areas / areas.sum())
        return self._samples[n_samples]

    def end_of(self, scan: np.ndarray, up: np.ndarray) -> End | None:
        """Return where a scan of a part of a body ends."""
        direction = self.cut * up
        return End(direction, float((scan @ direction).max())) if self.cut else None

    def find_visible(self, surface: np.ndarray, scan: np.ndarray, up: np.ndarray) -> np.ndarray:
        """Return which vertices a scan can show."""
        end = self.end_of(scan, up)
        return self._shown if end is None else self._shown & end.shows(surface)

    def run(
        self, scan: PreparedScan, *, again: bool = False, quick: bool = False
    ) -> list[Candidate]:
        """Return the bodies from the likeliest starts, the best first."""
        # A search that is done again starts from the headings between, and follows more starts. A
        # quick one follows fewer, and tries no arms.
        offset, more = (0.5, 2.0) if again else (0.0, 0.5 if quick else 1.0)
        rounds = [replace(each, n_best=int(more * each.n_best)) for each in _ROUNDS]
        rounds[0] = replace(rounds[0], n_best=int(max(more, 1.0) * _ROUNDS[0].n_best))
        ups = _AXES if scan.up is None else np.stack([scan.up, *scan.other_ups])
        if scan.up is None:
            few = [name for name in UP_POSES if name in self.poses] or list(self.poses)
            starts = [start for up in ups for start in self._starts(few, up, scan, offset)]
            best: dict[tuple[float, ...], float] = {}
            for candidate in self._follow(starts, rounds[:2], scan):
                best.setdefault(tuple(candidate.up), candidate.likelihood)
            likeliest = max(best.values())
            axes = sorted(best, key=lambda axis: -best[axis])[:2]
            ups = np.array([axis for axis in axes if best[axis] > likeliest - _UP_MARGIN])
        names = list(self.poses)
        starts = [start for up in ups for start in self._starts(names, up, scan, offset)]
        candidates = self._follow(starts, rounds, scan)
        return candidates if quick else self.with_likeliest_arms(candidates, scan)

    def _follow(
        self, candidates: list[Candidate], rounds: Sequence[Round], scan: PreparedScan
    ) -> list[Candidate]:
        """Return the likeliest candidates after some rounds, the best first."""
        for each in rounds:
            candidates = self._advance(candidates, each, scan)
        return candidates

    def with_likeliest_arms(
        self, candidates: list[Candidate], scan: PreparedScan
    ) -> list[Candidate]:
        """Return candidates, the best with each arm as in the start pose that is the likeliest."""
        best_body = candidates[0]
        for arm in self.arms:
            best_body = self._with_likeliest_arm(best_body, arm, scan)
        # The others still have the arms of their starts, so likelihoods compare as they were.
        return [replace(best_body, likelihood=candidates[0].likelihood), *candidates[1:]]

    def run_from(self, pose: Pose, up: np.ndarray, scan: PreparedScan) -> Candidate:
        """Return the body from one known start, the body a moment before."""
        warm = _WARM_BETAS_PRECISION * self.betas_precisions
        prior = self._prior(pose)._replace(betas_precisions=warm)
        start = Candidate(pose, prior, -np.inf, up, known=True)
        return self._follow([start], _WARM_ROUNDS, scan)[0]

    def _prior(self, pose: Pose) -> Prior:
        return Prior(pose.local, self.precisions, pose.betas, self.betas_precisions)

    def likelihood(self, pose: Pose, scan: PreparedScan, up: np.ndarray) -> float:
        """Return the mean log-likelihood of a scan with the last deviation of the last round."""
        last = _ROUNDS[-1]
        each = replace(last, sigmas=(last.sigmas[1], last.sigmas[1]), n_steps=0)
        candidate = Candidate(pose, self._prior(pose), -np.inf, up)
        return self._advance([candidate], each, replace(scan, landmarks={}))[0].likelihood

    def anneal_finely(self, best: Candidate, scan: PreparedScan) -> Pose:
        """Return a body after soft assignment with smaller deviations than in the search."""
        return self._advance([best], _FINE_ROUND, replace(scan, landmarks={}))[0].pose

    def _starts(
        self, names: list[str], up: np.ndarray, scan: PreparedScan, offset: float
    ) -> list[Candidate]:
        """Return starts with headings that differ by sixths of 360°, from an offset in sixths."""
        body = self.samples(_ROUNDS[0].n_model)
        upright = Rotation.align_vectors(up, _UP)[0].as_matrix()
        even = scan.points[scan.even_points(_ROUNDS[0].n_scan)]
        centre, end = even.mean(axis=0), self.end_of(scan.points, up)
        betas = np.zeros(len(self.betas_precisions))
        starts = []
        for name in names:
            for angle in (np.arange(_N_HEADINGS) + offset) * (2.0 * np.pi / _N_HEADINGS):
                local = self.poses[name].copy()
                local[self.root] = upright @ rotation_matrix(angle * _UP) @ local[self.root]
                pose = Pose(local, betas, np.zeros(3))
                points = pose_body(body, pose).points
                shift = centre - body.areas @ points
                if end is not None:
                    for _ in range(_N_SHIFTS):
                        shown = body.areas * end.shows(points + shift)
                        shift = centre - shown @ points / shown.sum()
                prior = self._prior(Pose(self.poses[name], betas, shift))
                starts.append(Candidate(Pose(local, betas, shift), prior, -np.inf, up))
        return starts

    def _with_likeliest_arm(
        self, body: Candidate, arm: np.ndarray, scan: PreparedScan
    ) -> Candidate:
        """Return a body with one arm as in a start pose if that is likelier, or as it is."""
        first, last = _ARM_ROUNDS
        others = []
        for rotations in other_arms(arm, body.prior.local, self.poses):
            local, expected = body.pose.local.copy(), body.prior.local.copy()
            local[arm] = expected[arm] = rotations
            pose, prior = body.pose._replace(local=local), body.prior._replace(local=expected)
            others.append(replace(body, pose=pose, prior=prior))
        others = self._advance(others, first, scan)
        (other,) = self._advance(others, last, scan)
        (own,) = self._advance([body], last, scan)
        return other if other.likelihood > own.likelihood + _ARM_GAIN else body

    def _advance(
        self, candidates: list[Candidate], each: Round, scan: PreparedScan
    ) -> list[Candidate]:
        """Return the likeliest candidates after one round, the best first."""
        body = self.samples(each.n_model)
        chosen = scan.even_points(each.n_scan)
        few = replace(scan, points=scan.points[chosen], normals=scan.normals[chosen])
        sigmas = np.append(np.geomspace(*each.sigmas, each.n_steps), each.sigmas[1])

        def advance(start: Candidate) -> Candidate:
            end = self.end_of(scan.points, start.up)
            pose, likelihood = anneal(body, start.pose, start.prior, few, sigmas, end)
            return replace(start, pose=pose, likelihood=likelihood)

        advanced = list(mapped(advance, candidates, N_THREADS))
        advanced.sort(key=lambda candidate: -candidate.likelihood)
        return _different(advanced, body, each.n_best)


def _different(candidates: list[Candidate], body: ModelSamples, n_best: int) -> list[Candidate]:
    """Return the best candidates that are not close to a better one."""
    different: list[Candidate] = []
    surfaces: list[np.ndarray] = []
    for candidate in candidates:
        if len(different) == n_best:
            break
        points = pose_body(body, candidate.pose).points
        if all(np.sqrt(np.mean((points - other) ** 2) * 3) > _SAME_METRES for other in surfaces):
            different.append(candidate)
            surfaces.append(points)
    return different
