"""The dense fit of a body to a scan from its likeliest start, whose vertices leave the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import cg
from scipy.spatial import cKDTree

from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.kernels.surface import unit_vectors, vertex_normals
from riemhuman.kernels.threads import mapped
from riemhuman.registration._posed_body import ModelSamples, Pose, Prior, pose_body, take_step
from riemhuman.registration._scan_preparation import PreparedScan
from riemhuman.registration._start_poses import joint_names, joints_below, rotate_forearm
from riemhuman.registration._start_search import N_THREADS, Candidate, StartSearch
from riemhuman.surfaces.nearest_points import nearest_points
from riemhuman.surfaces.template import Template

# Distance in metres that counts as much as a rotation of the normal by a radian.
_NORMAL_METRES = 0.05
# Number of scan points in an average, against noise.
_N_NEIGHBOURS = 4
_BLUR_METRES = 0.008
# Number of points from which noise is estimated, and the median of |x| for a standard normal x.
_N_NOISE, _MEDIAN = 3000, 0.6745

_MODEL_SCALES = (0.04, 0.03, 0.03, 0.03, *(0.02,) * 5, *(0.012,) * 4)
# The body of a moment before is nearer.
_KNOWN_SCALES = _MODEL_SCALES[6:]
_MODEL_ALONG = 0.05
# One unit of a coefficient counts as much as one point of the scan that lies so far off: the fewer
# points, the more the prior counts.
_PRIOR_METRES = 0.02
# Largest rotation of a joint in a step, radians.
_LONGEST = 0.3
# Inverse variance of the coefficients of hands, of which 1 is a pose of a hand.
_HANDS_PRECISION = 300.0
# Inverse variance of what does not move while an arm is fitted.
_FIXED = 1e15

_N_SURFACE_STEPS = 3
_FREE_ALONG = 0.05
_FREE_SCALE = 0.01
_CONJUGATE_STEPS, _CONJUGATE_TOLERANCE = 60, 3e-2

_N_DENSE = 3000
# Arms are fitted by their share of so many points of the body. Rotations whose likelihood is much
# below the best are left out.
_N_ROTATED, _LEAST_ROTATED = 1000, 0.06
# Rotations are different if the forearm and hand are this far apart, metres in the mean.
_DIFFERENT_METRES = 0.008
# Another rotation, or pose of the hand, must bring the scan nearer to the arm by this share, and by
# so many standard errors: few points tell little.
_LEAST_GAIN, _CHANCE = 0.05, 2.0
# Distances beyond these are of other parts of the scan, metres.
_ARM_METRES = 0.03
_HAND_METRES = 0.01
# Vertices that a pose of a hand moves by more are compared, metres.
_HAND_MOVES = 0.005
_ARM_STIFFNESSES = (1e-3, 3e-4, 1e-4, 5e-5)

# The elastic step softens to the last stiffness, which grows with the variance of the noise from
# this deviation in metres; after the model is fitted to its result, it starts again from there.
_FIRST_STIFFNESS, _LAST_STIFFNESS, _NOISE_METRES = 1e-3, 2e-5, 0.0009
_N_STEPS, _N_STEPS_AGAIN, _N_REPEATS = 6, 2, 2
# The model follows vertices without a match with this weight.
_UNMATCHED = 0.02

# Points farther outside the head are hair, unless it is more than this share of the scan.
_HAIR_METRES, _FARTHEST_HAIR, _MOST_HAIR = 0.02, 0.35, 0.1
_HEAD_JOINTS = ("head", "neck")


class Matches(NamedTuple):
    """The points of a scan that match the points of a body."""

    gaps: np.ndarray  # (n, 3) vectors from the points of the body to their matches, metres
    normals: np.ndarray  # (n, 3) normals of the scan at the matches
    weights: np.ndarray  # (n,) reliability of each match, between 0 and 1

    def only(self, chosen: np.ndarray) -> Matches:
        """Return the matches with weight 0 for all but the chosen points."""
        return self._replace(weights=self.weights * chosen)


class ScanTree:
    """A search tree for the points of a scan by position and normal."""

    def __init__(self, points: np.ndarray, normals: np.ndarray) -> None:
        self.points, self.normals = points, normals
        self._tree = cKDTree(np.concatenate([points, _NORMAL_METRES * normals], axis=1))

    @property
    def prior_weight(self) -> float:
        """The weight of the prior, square metres."""
        return _PRIOR_METRES**2 / len(self.points)

    @cached_property
    def noise(self) -> float:
        """The standard deviation of the points along their normals, metres.

        On a circle, the chord between two points is perpendicular to the mean of their normals, so
        what is left of it along this mean is noise.
        """
        chosen = np.linspace(0, len(self.points) - 1, _N_NOISE).astype(int)
        near = self._tree.query(self._tree.data[chosen], k=5)[1][:, 1:]
        chords = self.points[near] - self.points[chosen, np.newaxis]
        means = 0.5 * (self.normals[near] + self.normals[chosen, np.newaxis])
        heights = np.einsum("nkx,nkx->nk", chords, means)
        return float(np.median(np.abs(heights))) / (_MEDIAN * np.sqrt(2.0))

    def match(self, points: np.ndarray, normals: np.ndarray, scale: float) -> Matches:
        """Match the points of a body; a match at distance `scale` has a quarter of the weight."""
        places = np.concatenate([points, _NORMAL_METRES * normals], axis=1)
        far, near = self._tree.query(places, k=_N_NEIGHBOURS, workers=N_THREADS)
        shares = np.exp(-0.5 * (far**2 - far[:, :1] ** 2) / _BLUR_METRES**2)
        shares /= shares.sum(axis=1, keepdims=True)
        gaps = np.einsum("nk,nkx->nx", shares, self.points[near]) - points
        mean_normals = unit_vectors(np.einsum("nk,nkx->nx", shares, self.normals[near]))
        cosines = np.einsum("nx,nx->n", mean_normals, normals)
        weights = (scale**2 / (np.sum(gaps**2, axis=1) + scale**2)) ** 2
        return Matches(gaps, mean_normals, weights * np.clip(cosines, 0.0, 1.0))


def fit_closest(
    body: ModelSamples,
    pose: Pose,
    prior: Prior,
    scan: ScanTree,
    scales: tuple[float, ...] = _MODEL_SCALES,
) -> Pose:
    """Return the parameters that bring a body's points to the closest points of a scan.

    In each step, a match at the distance given by `scales` counts a quarter.
    """
    for scale in scales:
        posed = pose_body(body, pose)
        matches = scan.match(posed.points, posed.normals, scale)
        shares = body.areas * matches.weights
        pose = take_step(
            body,
            posed,
            prior,
            scan.prior_weight,
            shares,
            matches.gaps,
            matches.normals,
            _MODEL_ALONG,
            _LONGEST,
        )
    return pose


def fit_surface(
    body: ModelSamples,
    pose: Pose,
    prior: Prior,
    prior_weight: float,
    surface: np.ndarray,
    weights: np.ndarray,
) -> Pose:
    """Return the parameters that bring the model's vertices to a surface, with weights (V,)."""
    is_vertex = (body.numbers >= 0)[:, np.newaxis]
    shares = body.areas * weights[body.numbers]
    for _ in range(_N_SURFACE_STEPS):
        posed = pose_body(body, pose)
        gaps = np.where(is_vertex, surface[body.numbers] - posed.points, 0.0)
        pose = take_step(body, posed, prior, prior_weight, shares, gaps, gaps, 1.0, _LONGEST)
    return pose


def fit_elastic(
    metric: ElasticMetric,
    start: np.ndarray,
    reference: np.ndarray,
    scan: ScanTree,
    stiffnesses: Sequence[float] | np.ndarray,
    scale: float = _FREE_SCALE,
    visible: np.ndarray | None = None,
    matches: Matches | None = None,
) -> tuple[np.ndarray, Matches]:
    """Return a surface near a scan, elastically near a reference, and the matches of its vertices.

    Gauss–Newton steps minimise Σ_i w_i ((n_i·r_i)² + τ |r_i|²) + α d²(f, f₀), with the gaps r to
    the scan, its normals n, the elastic distance d from the reference f₀, and a stiffness α for
    each step. They use the matrix of the metric at the reference, and conjugate gradients solve
    the equations. Only visible vertices are matched, by default all. The matches of the start may
    be known.
    """
    template = metric.space.template
    faces, areas = template.faces, template.vertex_areas
    shown = np.ones(len(start), dtype=bool) if visible is None else visible
    # Single precision suffices for steps.
    system = sparse.bsr_array(metric.metric_matrix(reference), blocksize=(3, 3)).astype(np.float32)
    elastic, numbers = system.data, np.arange(len(start) + 1)
    on_diagonal = np.repeat(numbers[:-1], np.diff(system.indptr)) == system.indices
    points = start
    if matches is None:
        matches = scan.match(points, vertex_normals(points, faces), scale).only(shown)
    for stiffness in stiffnesses:
        weights = areas * matches.weights
        blocks = matches.normals[:, :, np.newaxis] * matches.normals[:, np.newaxis]
        blocks = weights[:, np.newaxis, np.newaxis] * (blocks + _FREE_ALONG * np.eye(3))
        pull = metric.energy_and_gradient(np.stack([reference, points]))[1][1]
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
        points = points + step.reshape(-1, 3)
        matches = scan.match(points, vertex_normals(points, faces), scale).only(shown)
    return points, matches


class DenseFit(NamedTuple):
    """A body fitted to all points of a scan."""

    pose: Pose
    model_points: np.ndarray  # (V, 3) the model's surface
    points: np.ndarray  # (V, 3) the surface after it left the model elastically
    matches: Matches


class _Arm(NamedTuple):
    """The surface of a forearm with its hand."""

    joints: np.ndarray  # from the collar to the wrist
    vertices: np.ndarray  # numbers in the model
    on_hand: np.ndarray  # those of them that poses of the hand move
    skin: ModelSamples  # these vertices
    samples: ModelSamples  # a few points of the whole arm
    metric: ElasticMetric
    hands: list[np.ndarray]  # coefficients of poses of this hand; NaN for the other


class DenseFitter:
    """Fits a body model to all points of a scan."""

    def __init__(self, search: StartSearch) -> None:
        self.search, self.model = search, search.model

    @cached_property
    def metric(self) -> ElasticMetric:
        return ElasticMetric(AlignedSurfaces(self.model.template), a=1.0, lam=1.0, c=1.0)

    @cached_property
    def _arms(self) -> list[_Arm]:
        return [_arm_surface(self.search, joints) for joints in self.search.arms]

    def surface(self, pose: Pose) -> np.ndarray:
        return pose_body(self.search.samples(None), pose).points[: self.model.n_vertices]

    @cached_property
    def _on_head(self) -> np.ndarray:
        """Which vertices belong to the head."""
        names = joint_names(self.model)
        joints = [names.index(name) for name in _HEAD_JOINTS if name in names]
        owned: np.ndarray = np.isin(self.model.weights.argmax(axis=1), joints)
        return owned

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

    def fit(self, best: Candidate, scan: PreparedScan) -> DenseFit:
        prior = best.prior._replace(
            betas_precisions=np.minimum(best.prior.betas_precisions, _HANDS_PRECISION)
        )
        tree = ScanTree(scan.points, scan.normals)
        # Where surfaces curve, soft assignment moves them inward; closest points do not.
        pose = self.search.anneal_finely(best, scan.points, scan.normals)
        visible = self.search.find_visible(self.surface(pose), scan.points, best.up)
        dense = self._samples(_N_DENSE, visible)
        scales = _KNOWN_SCALES if best.known else _MODEL_SCALES
        pose = fit_closest(dense, pose, prior, tree, scales)
        hair = self.find_hair(self.surface(pose), scan.points)
        if hair.any():
            scan = replace(scan, points=scan.points[~hair], normals=scan.normals[~hair])
            tree = ScanTree(scan.points, scan.normals)
            pose = fit_closest(dense, pose, prior, tree, scales)
        if not best.known:  # its arms are as a moment before
            pose = self._rotate_forearms(best, prior, pose, scan, tree, visible)
            pose, prior = self._pose_hands(prior, pose, scan, tree, visible)
        model_points = self.surface(pose)
        last = _LAST_STIFFNESS * max(1.0, tree.noise / _NOISE_METRES) ** 2
        softer = np.geomspace(_FIRST_STIFFNESS, min(last, _FIRST_STIFFNESS), _N_STEPS)
        points, matches = fit_elastic(
            self.metric, model_points, model_points, tree, softer, visible=visible
        )
        for _ in range(_N_REPEATS):
            weights = np.maximum(matches.weights, _UNMATCHED)
            pose = fit_surface(dense, pose, prior, tree.prior_weight, points, weights)
            model_points = self.surface(pose)
            softest = softer[-_N_STEPS_AGAIN:]
            points, matches = fit_elastic(
                self.metric, points, model_points, tree, softest, visible=visible, matches=matches
            )
        return DenseFit(pose, model_points, points, matches)

    def _samples(self, n_samples: int, visible: np.ndarray) -> ModelSamples:
        samples = self.search.samples(n_samples)
        areas = samples.areas * visible[samples.numbers]
        return samples._replace(areas=areas / areas.sum())

    def _rotate_forearms(
        self,
        best: Candidate,
        prior: Prior,
        pose: Pose,
        scan: PreparedScan,
        tree: ScanTree,
        visible: np.ndarray,
    ) -> Pose:
        """Return a fit with each forearm rotated so that its surface comes nearest to the scan."""

        def fit(other: Pose) -> tuple[float, Pose]:
            other = self._fit_arm(arm, other, prior, tree, visible)
            return self.search.likelihood(other, scan.points, scan.normals, best.up), other

        for arm in self._arms:
            own = _points_on(arm.vertices, self.surface(pose), scan)
            if not len(own):
                continue
            rotated = rotate_forearm(pose, arm.joints, arm.samples.rest_joints)
            found = list(mapped(fit, rotated, N_THREADS))
            found.sort(key=lambda each: -each[0])
            likely = [each for each in found if each[0] > found[0][0] - _LEAST_ROTATED]
            surfaces = [pose_body(arm.skin, pose).points]
            others: list[Pose] = []
            for _, other in likely:
                surface = pose_body(arm.skin, other).points
                if all(_gap(surface, each) > _DIFFERENT_METRES for each in surfaces):
                    surfaces.append(surface)
                    others.append(other)
            if not others:
                continue
            distances = []
            for surface in surfaces:
                fitted, _ = fit_elastic(arm.metric, surface, surface, tree, _ARM_STIFFNESSES)
                distances.append(_arm_distances(arm, fitted, own))
            nearest = int(np.argmin([each.mean() for each in distances]))
            if _are_less(distances[nearest], distances[0]):
                dense = self._samples(_N_DENSE, visible)
                pose = fit_closest(dense, others[nearest - 1], prior, tree)
        return pose

    def _pose_hands(
        self, prior: Prior, pose: Pose, scan: PreparedScan, tree: ScanTree, visible: np.ndarray
    ) -> tuple[Pose, Prior]:
        """Return a fit with each hand in the pose that comes nearest to the scan, and its prior.

        The elastic step would hide a wrong one: it presses fingers into a fist. Only points on the
        hand count, because those on the forearm lie as near in all poses.
        """
        n_betas = self.model.n_betas

        def fit(around: np.ndarray) -> tuple[np.ndarray, Pose, Prior]:
            betas = np.append(pose.betas[:n_betas], around)
            its_prior = prior._replace(betas=np.append(prior.betas[:n_betas], around))
            other = self._fit_arm(arm, pose._replace(betas=betas), its_prior, tree, visible)
            surface = pose_body(arm.skin, other).points
            return _arm_distances(arm, surface, own, _HAND_METRES), other, its_prior

        # Twice, because the wrist moves with the first change.
        for arm in (*self._arms, *self._arms):
            own = _points_on(arm.on_hand, self.surface(pose), scan)
            if not len(own):
                continue
            now = prior.betas[n_betas:]
            others = [now, *(np.where(np.isnan(hands), now, hands) for hands in arm.hands)]
            first, *found = mapped(fit, others, N_THREADS)
            nearest = min(found, key=lambda each: each[0].mean())
            if _are_less(nearest[0], first[0]):
                _, pose, prior = nearest
                pose = fit_closest(self._samples(_N_DENSE, visible), pose, prior, tree)
        return pose, prior

    def _fit_arm(
        self, arm: _Arm, start: Pose, prior: Prior, tree: ScanTree, visible: np.ndarray
    ) -> Pose:
        """Fit one arm and its hand; all else stays as it starts."""
        moving = np.isin(np.arange(self.model.n_joints), arm.joints[1:])
        of_hands = np.arange(len(start.betas)) >= self.model.n_betas
        of_arm = Prior(
            np.where(moving[:, np.newaxis, np.newaxis], prior.local, start.local),
            np.where(moving, prior.precisions, _FIXED),
            np.where(of_hands, prior.betas, start.betas),
            np.where(of_hands, prior.betas_precisions, _FIXED),
        )
        samples = arm.samples
        samples = samples._replace(areas=samples.areas * visible[samples.numbers])
        return fit_closest(samples, start, of_arm, tree)


def _arm_surface(search: StartSearch, joints: np.ndarray) -> _Arm:
    model = search.model
    owners = model.weights.argmax(axis=1)
    below = joints_below(model, joints[-2:].tolist())
    inside = np.isin(owners, below)
    faces = model.faces[inside[model.faces].all(axis=1)]
    used, corners = np.unique(faces, return_inverse=True)
    template = Template(model.template.vertices[used], corners.reshape(-1, 3))
    metric = ElasticMetric(AlignedSurfaces(template), a=1.0, lam=1.0, c=1.0)
    side = int(joint_names(model)[joints[-1]].startswith("right"))
    hands = []
    for pose in model.hand_poses:
        both = model.hand_pose(pose).reshape(2, -1)
        both[1 - side] = np.nan
        hands.append(both.ravel())
    moves = np.abs(model.hand_directions[used]).max(axis=(1, 2), initial=0.0)
    few = search.samples(_N_ROTATED)
    on_arm = np.isin(owners, joints_below(model, joints[1:].tolist()))
    samples = few.only(on_arm[few.numbers] & (few.numbers >= 0))
    skin = search.samples(None).only(used)
    return _Arm(joints, used, used[moves > _HAND_MOVES], skin, samples, metric, hands)


def _gap(first: np.ndarray, second: np.ndarray) -> float:
    """Return the mean distance between two surfaces, metres."""
    return float(np.linalg.norm(first - second, axis=1).mean())


def _points_on(vertices: np.ndarray, surface: np.ndarray, scan: PreparedScan) -> np.ndarray:
    """Return the points of a scan that lie near some vertices of a surface."""
    near = cKDTree(surface).query(scan.points, distance_upper_bound=0.1)[1]
    return scan.points[np.isin(near, vertices)]


def _arm_distances(
    arm: _Arm, surface: np.ndarray, points: np.ndarray, farthest: float = _ARM_METRES
) -> np.ndarray:
    """Return the distances of points from the surface of an arm, metres."""
    distances = nearest_points(points, surface, arm.metric.space.template.faces)[1]
    return np.minimum(distances, farthest)


def _are_less(some: np.ndarray, others: np.ndarray) -> bool:
    """Return whether distances of the same points are less, by more than chance makes them."""
    gains = others - some
    chance = _CHANCE * np.sqrt(np.mean(gains**2) / len(gains))
    return bool(gains.mean() > max(_LEAST_GAIN * others.mean(), chance))
