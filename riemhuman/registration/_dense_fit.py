"""The dense fit of a body to a scan from its likeliest start, whose vertices leave the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import cg
from scipy.spatial import cKDTree

from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.kernels.surface import vertex_normals
from riemhuman.kernels.threads import mapped
from riemhuman.registration._posed_body import ModelSamples, Pose, Prior, pose_body, take_step
from riemhuman.registration._scan_preparation import N_THREADS, Matches, PreparedScan
from riemhuman.registration._start_poses import rotate_forearm
from riemhuman.registration._start_search import Candidate, StartSearch
from riemhuman.surfaces.nearest_points import nearest_points
from riemhuman.surfaces.template import Template

_MODEL_SCALES = (0.04, 0.03, 0.03, 0.03, *(0.02,) * 5, *(0.012,) * 4)
# The body of a moment before is nearer.
_KNOWN_SCALES = _MODEL_SCALES[6:]
_MODEL_ALONG = 0.05
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


def fit_closest(
    body: ModelSamples,
    pose: Pose,
    prior: Prior,
    scan: PreparedScan,
    scales: tuple[float, ...] = _MODEL_SCALES,
) -> Pose:
    """Return the parameters that bring a body's points to the closest points of a scan."""
    for scale in scales:
        posed = pose_body(body, pose)
        gaps, normals, weights = scan.match(posed.points, posed.normals, scale)
        shares = body.areas * weights
        pose = take_step(
            posed, prior, scan.prior_weight, shares, gaps, normals, _MODEL_ALONG, _LONGEST
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
        return matches._replace(weights=matches.weights * visible)

    # Single precision suffices for steps.
    system = sparse.bsr_array(metric.metric_matrix(reference), blocksize=(3, 3)).astype(np.float32)
    elastic, numbers = system.data, np.arange(len(start) + 1)
    on_diagonal = np.repeat(numbers[:-1], np.diff(system.indptr)) == system.indices
    points, matches = start, match(start)
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
        matches = match(points)
    return points, matches


class _Arm:
    """The surface of a forearm with its hand."""

    def __init__(self, search: StartSearch, joints: np.ndarray) -> None:
        model, parts = search.model, search.parts
        self.joints = joints  # from the collar to the wrist
        inside = parts.vertices(joints[-2:].tolist())
        faces = model.faces[inside[model.faces].all(axis=1)]
        self.vertices, corners = np.unique(faces, return_inverse=True)  # numbers in the model
        self.faces = corners.reshape(-1, 3)
        template = Template(model.template.vertices[self.vertices], self.faces)
        self.metric = ElasticMetric(AlignedSurfaces(template), a=1.0, lam=1.0, c=1.0)
        self.skin = search.samples(None).only(self.vertices)
        # A few points of the whole arm, and the vertices that poses of the hand move.
        few, on_arm = search.samples(_N_ROTATED), parts.vertices(joints[1:].tolist())
        self.samples = few.only(on_arm[few.numbers] & (few.numbers >= 0))
        moves = np.abs(model.hand_directions[self.vertices]).max(axis=(1, 2), initial=0.0)
        self.on_hand = self.vertices[moves > _HAND_MOVES]
        # Coefficients of poses of this hand; NaN for the other.
        hands = [model.hand_pose(pose).reshape(2, -1) for pose in model.hand_poses]
        is_right = parts.names[joints[-1]].startswith("right")
        own = np.array([[not is_right], [is_right]])
        self.hands = [np.where(own, both, np.nan).ravel() for both in hands]

    def distances(self, surface: np.ndarray, points: np.ndarray, farthest: float) -> np.ndarray:
        """Return the distances of points from the surface of the arm, metres."""
        return np.minimum(nearest_points(points, surface, self.faces)[1], farthest)


class DenseFitter(StartSearch):
    """The search for starts, and what fits of one body model to all points of scans share."""

    @cached_property
    def metric(self) -> ElasticMetric:
        return ElasticMetric(AlignedSurfaces(self.model.template), a=1.0, lam=1.0, c=1.0)

    @cached_property
    def arm_surfaces(self) -> list[_Arm]:
        return [_Arm(self, joints) for joints in self.arms]

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


class DenseFit:
    """A body fitted to all points of a scan, from its likeliest start."""

    def __init__(self, fitter: DenseFitter, best: Candidate, scan: PreparedScan) -> None:
        self._fitter, self._model = fitter, fitter.model
        self._best, self._scan = best, scan
        betas_precisions = np.minimum(best.prior.betas_precisions, _HANDS_PRECISION)
        self._prior = best.prior._replace(betas_precisions=betas_precisions)
        # Where surfaces curve, soft assignment moves them inward; closest points do not.
        self.pose = fitter.anneal_finely(best, scan)
        self._visible = fitter.find_visible(fitter.surface(self.pose), scan.points, best.up)
        dense = fitter.samples(_N_DENSE)
        areas = dense.areas * self._visible[dense.numbers]
        self._dense = dense._replace(areas=areas / areas.sum())
        scales = _KNOWN_SCALES if best.known else _MODEL_SCALES
        self._fit_closest(self.pose, scales)
        hair = fitter.find_hair(fitter.surface(self.pose), scan.points)
        if hair.any():
            self._scan = replace(scan, points=scan.points[~hair], normals=scan.normals[~hair])
            self._fit_closest(self.pose, scales)
        if not best.known:  # its arms are as a moment before
            self._rotate_forearms()
            self._pose_hands()
        self._leave_model()

    def _fit_closest(self, start: Pose, scales: tuple[float, ...] = _MODEL_SCALES) -> None:
        self.pose = fit_closest(self._dense, start, self._prior, self._scan, scales)

    def _leave_model(self) -> None:
        """Take the elastic step, and fit the model to its result again, twice."""
        metric, scan = self._fitter.metric, self._scan
        last = _LAST_STIFFNESS * max(1.0, scan.noise / _NOISE_METRES) ** 2
        softer = np.geomspace(_FIRST_STIFFNESS, min(last, _FIRST_STIFFNESS), _N_STEPS)
        self.model_points = self._fitter.surface(self.pose)  # (V, 3)
        self.points, self.matches = fit_elastic(
            metric, self.model_points, self.model_points, scan, softer, visible=self._visible
        )
        for _ in range(_N_REPEATS):
            self._fit_surface(np.maximum(self.matches.weights, _UNMATCHED))
            self.model_points = self._fitter.surface(self.pose)
            softest = softer[-_N_STEPS_AGAIN:]
            self.points, self.matches = fit_elastic(
                metric, self.points, self.model_points, scan, softest, visible=self._visible
            )

    def _fit_surface(self, weights: np.ndarray) -> None:
        """Bring the model's vertices to those that left it, with weights (V,)."""
        numbers = self._dense.numbers
        is_vertex = (numbers >= 0)[:, np.newaxis]
        shares = self._dense.areas * weights[numbers]
        for _ in range(_N_SURFACE_STEPS):
            posed = pose_body(self._dense, self.pose)
            gaps = np.where(is_vertex, self.points[numbers] - posed.points, 0.0)
            weight = self._scan.prior_weight
            self.pose = take_step(posed, self._prior, weight, shares, gaps, gaps, 1.0, _LONGEST)

    def _rotate_forearms(self) -> None:
        """Rotate each forearm so that its surface comes nearest to the scan."""

        def fit(other: Pose) -> tuple[float, Pose]:
            other = self._fit_arm(arm, other, self._prior)
            return self._fitter.likelihood(other, self._scan, self._best.up), other

        for arm in self._fitter.arm_surfaces:
            own = self._points_on(arm.vertices)
            if not len(own):
                continue
            rotated = rotate_forearm(self.pose, arm.joints, arm.samples.skeleton.rest_joints)
            found = list(mapped(fit, rotated, N_THREADS))
            found.sort(key=lambda each: -each[0])
            surfaces = [pose_body(arm.skin, self.pose).points]
            others: list[Pose] = []
            for likelihood, other in found:
                surface = pose_body(arm.skin, other).points
                gaps = [np.linalg.norm(surface - each, axis=1).mean() for each in surfaces]
                if likelihood > found[0][0] - _LEAST_ROTATED and min(gaps) > _DIFFERENT_METRES:
                    surfaces.append(surface)
                    others.append(other)
            if not others:
                continue
            distances = []
            for surface in surfaces:
                fitted, _ = fit_elastic(arm.metric, surface, surface, self._scan, _ARM_STIFFNESSES)
                distances.append(arm.distances(fitted, own, _ARM_METRES))
            nearest = int(np.argmin([each.mean() for each in distances]))
            if _are_less(distances[nearest], distances[0]):
                self._fit_closest(others[nearest - 1])

    def _pose_hands(self) -> None:
        """Give each hand the pose that comes nearest to the scan."""
        # The elastic step would hide a wrong one: it presses fingers into a fist. Only points on
        # the hand count, because those on the forearm lie as near in all poses.
        n_betas = self._model.n_betas

        def fit(around: np.ndarray) -> tuple[np.ndarray, Pose, Prior]:
            prior = self._prior._replace(betas=np.append(self._prior.betas[:n_betas], around))
            start = self.pose._replace(betas=np.append(self.pose.betas[:n_betas], around))
            pose = self._fit_arm(arm, start, prior)
            surface = pose_body(arm.skin, pose).points
            return arm.distances(surface, own, _HAND_METRES), pose, prior

        # Twice, because the wrist moves with the first change, if there is one.
        tried: dict[_Arm, Pose] = {}
        for arm in (*self._fitter.arm_surfaces, *self._fitter.arm_surfaces):
            if tried.get(arm) is self.pose:
                continue
            tried[arm] = self.pose
            own = self._points_on(arm.on_hand)
            if not len(own):
                continue
            now = self._prior.betas[n_betas:]
            others = [now, *(np.where(np.isnan(hands), now, hands) for hands in arm.hands)]
            first, *found = mapped(fit, others, N_THREADS)
            distances, pose, prior = min(found, key=lambda each: each[0].mean())
            if _are_less(distances, first[0]):
                self._prior = prior
                self._fit_closest(pose)

    def _points_on(self, vertices: np.ndarray) -> np.ndarray:
        """Return the points of the scan that lie near some vertices."""
        surface = self._fitter.surface(self.pose)
        near = cKDTree(surface).query(self._scan.points, distance_upper_bound=0.1)[1]
        return self._scan.points[np.isin(near, vertices)]

    def _fit_arm(self, arm: _Arm, start: Pose, prior: Prior) -> Pose:
        """Fit one arm and its hand; all else stays as it starts."""
        moving = np.isin(np.arange(self._model.n_joints), arm.joints[1:])
        of_hands = np.arange(len(start.betas)) >= self._model.n_betas
        of_arm = Prior(
            np.where(moving[:, np.newaxis, np.newaxis], prior.local, start.local),
            np.where(moving, prior.precisions, _FIXED),
            np.where(of_hands, prior.betas, start.betas),
            np.where(of_hands, prior.betas_precisions, _FIXED),
        )
        samples = arm.samples
        samples = samples._replace(areas=samples.areas * self._visible[samples.numbers])
        return fit_closest(samples, start, of_arm, self._scan)


def _are_less(some: np.ndarray, others: np.ndarray) -> bool:
    """Return whether distances of the same points are less, by more than chance makes them."""
    gains = others - some
    chance = _CHANCE * np.sqrt(np.mean(gains**2) / len(gains))
    return bool(gains.mean() > max(_LEAST_GAIN * others.mean(), chance))
