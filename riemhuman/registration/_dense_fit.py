"""The dense fit of a body to a scan from its likeliest start: forearms, hair and free vertices."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from riemhuman.bodies import BodyModel
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.kernels.surface import vertex_normals
from riemhuman.kernels.threads import mapped
from riemhuman.registration._closest_points import (
    Matches,
    ScanTree,
    fit_closest,
    fit_elastic,
    fit_surface,
)
from riemhuman.registration._posed_body import Pose, pose_body
from riemhuman.registration._scan_preparation import PreparedScan
from riemhuman.registration._start_poses import joint_names, joints_below, rotate_forearm
from riemhuman.registration._start_search import N_THREADS, Candidate, StartSearch
from riemhuman.surfaces.nearest_points import nearest_points
from riemhuman.surfaces.template import Template

_N_DENSE = 3000
# Rotations of a forearm are compared on so many points of the body; those whose likelihood is much
# below the best are left out.
_N_ROTATED, _LEAST_ROTATED = 1000, 0.06
# Rotations are different if the forearm and hand are this far apart, metres in the mean.
_DIFFERENT_METRES = 0.008
# Another rotation must bring the scan nearer to the arm by this share.
_LEAST_GAIN = 0.05
# Distances beyond this are of other parts of the scan, metres.
_ARM_METRES = 0.03
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
    metric: ElasticMetric


class DenseFitter:
    """Fits a body model to all points of a scan."""

    def __init__(self, search: StartSearch) -> None:
        self.search, self.model = search, search.model

    @cached_property
    def metric(self) -> ElasticMetric:
        return ElasticMetric(AlignedSurfaces(self.model.template), a=1.0, lam=1.0, c=1.0)

    @cached_property
    def _arms(self) -> list[_Arm]:
        return [_arm_surface(self.model, joints) for joints in self.search.arms]

    def surface(self, pose: Pose) -> np.ndarray:
        return pose_body(self.search.samples(None), pose)[0][: self.model.n_vertices]

    @cached_property
    def _on_head(self) -> np.ndarray:
        """Which vertices belong to the head."""
        names = joint_names(self.model)
        joints = [names.index(name) for name in _HEAD_JOINTS if name in names]
        owned: np.ndarray = np.isin(self.model.weights.argmax(axis=1), joints)
        return owned & self.search.visible

    def find_hair(self, surface: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return which points of a scan lie so far outside the head that they are hair or a hat."""
        hair = np.zeros(len(points), dtype=bool)
        head = surface[self._on_head]
        if not len(head):
            return hair
        low, high = head.min(axis=0) - _FARTHEST_HAIR, head.max(axis=0) + _FARTHEST_HAIR
        around = np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
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
        tree = ScanTree(scan.points, scan.normals)
        dense = self.search.samples(_N_DENSE)
        # Where surfaces curve, soft assignment moves them inward; closest points do not.
        pose = self.search.anneal_finely(best.pose, best.prior, scan.points, scan.normals)
        pose = fit_closest(dense, pose, best.prior, tree)
        hair = self.find_hair(self.surface(pose), scan.points)
        if hair.any():
            scan = replace(scan, points=scan.points[~hair], normals=scan.normals[~hair])
            tree = ScanTree(scan.points, scan.normals)
            pose = fit_closest(dense, pose, best.prior, tree)
        pose = self._rotate_forearms(best, pose, scan, tree)
        model_points = self.surface(pose)
        last = _LAST_STIFFNESS * max(1.0, tree.noise / _NOISE_METRES) ** 2
        softer = np.geomspace(_FIRST_STIFFNESS, min(last, _FIRST_STIFFNESS), _N_STEPS)
        visible = self.search.visible
        points, matches = fit_elastic(
            self.metric, model_points, model_points, tree, softer, visible=visible
        )
        for _ in range(_N_REPEATS):
            weights = np.maximum(matches.weights, _UNMATCHED)
            pose = fit_surface(dense, pose, best.prior, tree.prior_weight, points, weights)
            model_points = self.surface(pose)
            softest = softer[-_N_STEPS_AGAIN:]
            points, matches = fit_elastic(
                self.metric, points, model_points, tree, softest, visible=visible
            )
        return DenseFit(pose, model_points, points, matches)

    def _rotate_forearms(
        self, best: Candidate, pose: Pose, scan: PreparedScan, tree: ScanTree
    ) -> Pose:
        """Return a fit with each forearm rotated so that its surface comes nearest to the scan."""
        few = self.search.samples(_N_ROTATED)

        def fit(pose: Pose) -> tuple[float, Pose]:
            pose = fit_closest(few, pose, best.prior, tree)
            return self.search.likelihood(pose, scan.points, scan.normals), pose

        for arm in self._arms:
            found = list(mapped(fit, rotate_forearm(pose, arm.joints, few.rest_joints), N_THREADS))
            found.sort(key=lambda each: -each[0])
            likely = [each for each in found if each[0] > found[0][0] - _LEAST_ROTATED]
            surfaces = [self.surface(pose)]
            others: list[Pose] = []
            for _, other in likely:
                surface = self.surface(other)
                if all(_gap(surface, each, arm) > _DIFFERENT_METRES for each in surfaces):
                    surfaces.append(surface)
                    others.append(other)
            if not others:
                continue
            near = cKDTree(surfaces[0]).query(scan.points, distance_upper_bound=0.1)[1]
            own = scan.points[np.isin(near, arm.vertices)]
            if not len(own):
                continue
            distances = [_arm_distance(arm, surface, own, tree) for surface in surfaces]
            nearest = int(np.argmin(distances))
            if nearest and distances[nearest] < (1.0 - _LEAST_GAIN) * distances[0]:
                dense = self.search.samples(_N_DENSE)
                pose = fit_closest(dense, others[nearest - 1], best.prior, tree)
        return pose


def _arm_surface(model: BodyModel, joints: np.ndarray) -> _Arm:
    below = joints_below(model, joints[-2:].tolist())
    inside = np.isin(model.weights.argmax(axis=1), below)
    faces = model.faces[inside[model.faces].all(axis=1)]
    used, corners = np.unique(faces, return_inverse=True)
    template = Template(model.template.vertices[used], corners.reshape(-1, 3))
    return _Arm(joints, used, ElasticMetric(AlignedSurfaces(template), a=1.0, lam=1.0, c=1.0))


def _gap(first: np.ndarray, second: np.ndarray, arm: _Arm) -> float:
    """Return the mean distance between the vertices of an arm on two surfaces, metres."""
    own = arm.vertices
    return float(np.linalg.norm(first[own] - second[own], axis=1).mean())


def _arm_distance(arm: _Arm, surface: np.ndarray, points: np.ndarray, tree: ScanTree) -> float:
    """Return the mean distance of points from an arm after an elastic step, metres."""
    own = surface[arm.vertices]
    fitted, _ = fit_elastic(arm.metric, own, own, tree, _ARM_STIFFNESSES)
    distances = nearest_points(points, fitted, arm.metric.space.template.faces)[1]
    return float(np.minimum(distances, _ARM_METRES).mean())
