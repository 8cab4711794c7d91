"""The dense fit of a body to a scan from its likeliest start, whose vertices leave the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import cg
from scipy.spatial import cKDTree

from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.kernels.surface import vertex_normals
from riemhuman.registration._arm_surfaces import ArmSurface
from riemhuman.registration._posed_body import (
    ModelSamples,
    Pose,
    Prior,
    pose_body,
    take_step,
)
from riemhuman.registration._scan_preparation import Matches, PreparedScan
from riemhuman.registration._start_search import Candidate, StartSearch
from riemhuman.surfaces.nearest_points import nearest_points

MODEL_SCALES = (0.04, 0.03, 0.03, 0.03, *(0.02,) * 5, *(0.012,) * 4)
# The body of a moment before is nearer.
_KNOWN_SCALES = MODEL_SCALES[6:]
_MODEL_ALONG = 0.05
# Largest rotation of a joint in a step, radians.
_LONGEST = 0.3
# Inverse variance of the coefficients of hands, of which 1 is a pose of a hand.
_HANDS_PRECISION = 300.0

_N_SURFACE_STEPS = 3
_FREE_ALONG = 0.05
_FREE_SCALE = 0.01
_CONJUGATE_STEPS, _CONJUGATE_TOLERANCE = 60, 3e-2

_N_DENSE = 3000

# The elastic step softens to the last stiffness, which grows with the variance of the noise from
# this deviation in metres; after the model is fitted to its result, it starts again from there.
_FIRST_STIFFNESS, _LAST_STIFFNESS, _NOISE_METRES = 1e-3, 2e-5, 0.0014
_N_STEPS, _N_STEPS_AGAIN, _N_REPEATS = 6, 2, 2
# Halvings of a step after which the cost must have fallen, or it is made as it is.
_MOST_HALVINGS = 6
# The model follows vertices without a match with this weight.
_UNMATCHED = 0.02

# Points farther outside the head are hair, unless it is more than this share of the scan.
_HAIR_METRES, _FARTHEST_HAIR, _MOST_HAIR = 0.02, 0.35, 0.1


def fit_closest(
    body: ModelSamples,
    pose: Pose,
    prior: Prior,
    scan: PreparedScan,
    scales: tuple[float, ...] = MODEL_SCALES,
) -> Pose:
    """Return the parameters that bring a body's points to the closest points of a scan."""
    for scale in scales:
        posed = pose_body(body, pose)
        gaps, normals, weights, *_ = scan.match(posed.points, posed.normals, scale)
        shares = body.areas * weights
        pose = take_step(
            posed,
            prior,
            scan.prior_weight,
            shares,
            gaps,
            normals,
            _MODEL_ALONG,
            _LONGEST,
        )
    return pose


def fit_elastic(
    metric: ElasticMetric,
    start: np.ndarray,
    reference: np.ndarray,
    scan: PreparedScan,
    stiffnesses: Sequence[float] | np.ndarray,
    scale: float = _FREE_SCALE,
    visible: np.ndarray | bool = True,
) -> tuple[np.ndarray, Matches]:
    """Return a surface near a scan, elastically near a reference, and the matches of vertices."""
    # Gauss–Newton steps, one for each stiffness, minimise the cost of `TemplateRegistration` with
    # the matrix of the metric at the reference.
    template = metric.space.template
    faces, areas = template.faces, template.vertex_areas

    def match(points: np.ndarray) -> Matches:
        matches = scan.match(points, vertex_normals(points, faces), scale)
        return matches._replace(
            weights=matches.weights * visible, reliable=matches.reliable * visible
        )

    # Single precision suffices for steps.
    system = sparse.bsr_array(metric.metric_matrix(reference), blocksize=(3, 3)).astype(np.float32)
    elastic, numbers = system.data, np.arange(len(start) + 1)
    on_diagonal = np.repeat(numbers[:-1], np.diff(system.indptr)) == system.indices

    def pull_to(points: np.ndarray) -> tuple[float, np.ndarray]:
        energy, gradient = metric.energy_and_gradient(np.stack([reference, points]))
        return energy, gradient[1]

    points, matches = start, match(start)
    energy, pull = pull_to(start)
    for stiffness in stiffnesses:
        weights = areas * matches.weights
        blocks = matches.normals[:, :, np.newaxis] * matches.normals[:, np.newaxis]
        blocks = weights[:, np.newaxis, np.newaxis] * (blocks + _FREE_ALONG * np.eye(3))
        right = np.einsum("nxy,ny->nx", blocks, matches.gaps) - 0.5 * stiffness * pull
        system.data = np.float32(stiffness) * elastic
        system.data[on_diagonal] += blocks
        inverse = np.linalg.inv(system.data[on_diagonal])
        step, _ = cg(
            system,
            right.ravel().astype(np.float32),
            rtol=_CONJUGATE_TOLERANCE,
            maxiter=_CONJUGATE_STEPS,
            M=sparse.bsr_array((inverse, numbers[:-1], numbers)),
        )
        step = step.reshape(-1, 3)
        cost = _squares(matches.gaps, blocks) + stiffness * energy
        # Where triangles nearly vanish, a whole step may go too far.
        energy, pull = pull_to(points + step)
        for _ in range(_MOST_HALVINGS):
            if _squares(matches.gaps - step, blocks) + stiffness * energy <= cost:
                break
            step = 0.5 * step
            energy, pull = pull_to(points + step)
        points = points + step
        matches = match(points)
    return points, matches


def _squares(gaps: np.ndarray, blocks: np.ndarray) -> float:
    """Return the sum of weighted squares of gaps, with a matrix of weights for each."""
    return float(np.einsum("nx,nxy,ny->", gaps, blocks, gaps, optimize=True))


class DenseFitter(StartSearch):
    """The search for starts, and what fits of one body model to all points of scans share."""

    @cached_property
    def metric(self) -> ElasticMetric:
        return ElasticMetric(AlignedSurfaces(self.model.template), a=1.0, lam=1.0, c=1.0)

    @cached_property
    def arm_surfaces(self) -> list[ArmSurface]:
        return [ArmSurface(self, joints) for joints in self.arms]

    def expect_feet(self, best: Candidate) -> np.ndarray:
        """Return expected rotations, with feet as in the start pose whose legs are nearest."""
        # Standing legs may come from a start that kneels: feet that a scan does not show would
        # point.
        expected: np.ndarray = best.prior.local.copy()
        for side in () if best.known else ("left", "right"):
            leg = self.parts.numbers(f"{side}_hip", f"{side}_knee")
            foot = self.parts.numbers(f"{side}_ankle", f"{side}_toes")
            nearest = min(
                self.poses.values(),
                key=lambda pose: float(np.linalg.norm(pose[leg] - best.pose.local[leg])),
            )
            expected[foot] = nearest[foot]
        return expected

    def surface(self, pose: Pose) -> np.ndarray:
        return pose_body(self.samples(None), pose).points[: self.model.n_vertices]

    @cached_property
    def _on_head(self) -> np.ndarray:
        on_head: np.ndarray = np.isin(self.parts.owners, self.parts.numbers("head", "neck"))
        return on_head

    def find_hair(self, surface: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return which points of a scan lie so far outside the head that they are hair or a hat."""
        hair = np.zeros(len(points), dtype=bool)
        head = surface[self._on_head]
        if not len(head):
            return hair
        low, high = head.min(axis=0) - _FARTHEST_HAIR, head.max(axis=0) + _FARTHEST_HAIR
        around = np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
        # Points near a vertex are near the surface.
        around = around[cKDTree(surface).query(points[around])[0] > _HAIR_METRES]
        if not len(around):
            return hair
        places, gaps = nearest_points(points[around], surface, self.model.faces)
        near = self.model.faces[places.triangles, places.barycentric.argmax(axis=1)]
        normals = vertex_normals(surface, self.model.faces)[near]
        heights = np.einsum("nx,nx->n", points[around] - surface[near], normals)
        far = (gaps > _HAIR_METRES) & (gaps < _FARTHEST_HAIR) & (heights > 0.0)
        hair[around[far & self._on_head[near]]] = True
        return hair if hair.mean() < _MOST_HAIR else np.zeros_like(hair)


@dataclass(frozen=True)
class DenseTask:
    """What the stages of a dense fit share: one scan, and what is known about its body."""

    fitter: DenseFitter
    scan: PreparedScan
    prior: Prior
    up: np.ndarray  # (3,)
    visible: np.ndarray  # (V,) vertices that the scan can show
    samples: ModelSamples  # points of the body, whose areas are 0 where it cannot


@dataclass(frozen=True)
class DenseFit:
    """A body fitted to all points of a scan."""

    pose: Pose
    model_points: np.ndarray  # (V, 3) surface of the model
    points: np.ndarray  # (V, 3) surface that left the model
    matches: Matches  # of the vertices


def fit_densely(fitter: DenseFitter, best: Candidate, scan: PreparedScan) -> tuple[DenseTask, Pose]:
    """Return the body of the likeliest start fitted to all points of a scan but hair."""
    precisions = best.prior.precisions.copy()
    for arm in fitter.arm_surfaces:
        precisions[arm.joints[-1]] = np.radians(arm.settings.wrist_degrees) ** -2.0
    prior = best.prior._replace(
        local=fitter.expect_feet(best),
        precisions=np.minimum(precisions, best.prior.precisions),
        betas_precisions=np.minimum(best.prior.betas_precisions, _HANDS_PRECISION),
    )
    # Where surfaces curve, soft assignment moves them inward; closest points do not.
    pose = fitter.anneal_finely(best, scan)
    visible = fitter.find_visible(fitter.surface(pose), scan.points, best.up)
    samples = fitter.samples(_N_DENSE)
    areas = samples.areas * visible[samples.numbers]
    samples = samples._replace(areas=areas / areas.sum())
    scales = _KNOWN_SCALES if best.known else MODEL_SCALES
    pose = fit_closest(samples, pose, prior, scan, scales)
    hair = fitter.find_hair(fitter.surface(pose), scan.points)
    if hair.any():
        scan = replace(scan, points=scan.points[~hair], normals=scan.normals[~hair])
        pose = fit_closest(samples, pose, prior, scan, scales)
    return DenseTask(fitter, scan, prior, best.up, visible, samples), pose


def leave_model(task: DenseTask, pose: Pose) -> DenseFit:
    """Take the elastic step, and fit the model to its result again, twice."""
    metric, scan = task.fitter.metric, task.scan
    softer = np.geomspace(_FIRST_STIFFNESS, last_stiffness(scan.noise), _N_STEPS)
    reference = task.fitter.surface(pose)
    points, matches = fit_elastic(metric, reference, reference, scan, softer, visible=task.visible)
    for _ in range(_N_REPEATS):
        weights = np.maximum(matches.weights, _UNMATCHED)
        pose = _fit_surface(task, pose, points, weights)
        reference = task.fitter.surface(pose)
        points, matches = fit_elastic(
            metric,
            points,
            reference,
            scan,
            softer[-_N_STEPS_AGAIN:],
            visible=task.visible,
        )
    return DenseFit(pose, reference, points, matches)


def last_stiffness(noise: float) -> float:
    """Return the stiffness α of the last elastic steps for a scan with such noise, metres."""
    softest = _LAST_STIFFNESS * max(1.0, noise / _NOISE_METRES) ** 2
    return min(softest, _FIRST_STIFFNESS)


def _fit_surface(task: DenseTask, pose: Pose, points: np.ndarray, weights: np.ndarray) -> Pose:
    """Return the pose whose vertices come to those that left the model, with weights (V,)."""
    numbers = task.samples.numbers
    is_vertex = (numbers >= 0)[:, np.newaxis]
    shares = task.samples.areas * weights[numbers]
    for _ in range(_N_SURFACE_STEPS):
        posed = pose_body(task.samples, pose)
        gaps = np.where(is_vertex, points[numbers] - posed.points, 0.0)
        prior_weight = task.scan.prior_weight
        pose = take_step(posed, task.prior, prior_weight, shares, gaps, gaps, 1.0, _LONGEST)
    return pose
