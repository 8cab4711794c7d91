"""The dense fit of a body's parameters to all points of a scan, from its likeliest start.

In go a prepared scan and the best `Candidate` of the search; out comes a `DenseFit`, whose `task`
holds what later stages share. They fit single limbs by `fit_joints`, which holds everything else.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial import cKDTree

from riemhuman.arrays import Array, Booleans, Integers
from riemhuman.kernels.surface import vertex_normals
from riemhuman.registration._constants import (
    CLEARLY_NEAR,
    DENSE_ALONG,
    DENSE_SCALES,
    FARTHEST_HAIR,
    HANDS_PRECISION,
    LONGEST_ROTATION,
    MATCHED_METRES,
    MOST_HAIR,
    N_DENSE,
    N_FIRST_STEPS,
    N_NEAR,
    WRIST_DEGREES,
)
from riemhuman.registration._limbs import ArmSurface
from riemhuman.registration._posed_body import (
    ModelSamples,
    Pose,
    Prior,
    normal_equations,
    pose_body,
    take_step,
)
from riemhuman.registration._registration_model import RegistrationModel
from riemhuman.registration._scan_preparation import PreparedScan, even_points
from riemhuman.registration._start_search import Candidate
from riemhuman.surfaces.nearest_points import nearest_points

# Inverse variance of parameters that are held while a limb is fitted.
_FIXED = 1e15


@dataclass(frozen=True)
class DenseTask:
    """What the stages of a dense fit share: a scan, and what is known about its body."""

    body: RegistrationModel
    scan: PreparedScan
    prior: Prior
    up: Array  # (3,)
    visible: Booleans  # (V,) vertices that the scan can show
    samples: ModelSamples  # points of the body, whose areas are 0 where it cannot


@dataclass(frozen=True)
class LimbFit:
    """One way to explain the points of a scan on some limbs."""

    pose: Pose
    prior: Prior
    surface: Array  # (n, 3) vertices of the limbs on the model
    distances: Array  # (m,) of the points from them, raised if they are implausible, metres

    @property
    def cost(self) -> float:
        """The mean distance, metres."""
        return float(self.distances.mean())


@dataclass(frozen=True, eq=False)
class DenseFit:
    """A body fitted to the closest points of a scan, and what else its arms might be."""

    task: DenseTask
    pose: Pose
    is_refused: bool  # whether much of the scan is so far away that details do not matter
    # As an arm or hand is, then in other poses; empty until these are tried.
    arm_fits: Mapping[ArmSurface, list[LimbFit]] = field(default_factory=dict)
    hand_fits: Mapping[ArmSurface, list[LimbFit]] = field(default_factory=dict)


def fit_densely(body: RegistrationModel, best: Candidate, scan: PreparedScan) -> DenseFit:
    """Return the body of the likeliest start, fitted to all points of a scan except hair."""
    whole = scan.points
    precisions = best.prior.precisions.copy()
    for arm in body.arm_surfaces:
        precisions[arm.joints[-1]] = np.radians(WRIST_DEGREES) ** -2.0
    prior = best.prior._replace(
        local=expect_feet(body, best),
        precisions=np.minimum(precisions, best.prior.precisions),
        betas_precisions=np.minimum(best.prior.betas_precisions, HANDS_PRECISION),
    )
    visible = body.find_visible(body.surface(best.pose), scan.points, best.up)
    samples = body.samples(N_DENSE).showing(visible)
    scales = DENSE_SCALES[N_FIRST_STEPS:] if best.known else DENSE_SCALES
    pose = fit_closest(samples, best.pose, prior, scan, scales)
    hair = find_hair(body, body.surface(pose), scan.points)
    if hair.any():
        scan = replace(scan, points=scan.points[~hair], normals=scan.normals[~hair])
        pose = fit_closest(samples, pose, prior, scan, scales)
    task = DenseTask(body, scan, prior, best.up, visible, samples)
    return DenseFit(task, pose, is_clearly_refused(body, pose, whole, scan.near_metres))


def expect_feet(body: RegistrationModel, best: Candidate) -> Array:
    """Return expected rotations, with feet as in the start pose whose legs are nearest."""
    # Standing legs may come from a kneeling start, in which unseen feet would be pointed.
    expected: Array = best.prior.local.copy()
    for side in () if best.known else ("left", "right"):
        leg = body.parts.numbers(f"{side}_hip", f"{side}_knee")
        foot = body.parts.numbers(f"{side}_ankle", f"{side}_toes")
        nearest = min(
            body.poses.values(),
            key=lambda pose: float(np.linalg.norm(pose[leg] - best.pose.local[leg])),
        )
        expected[foot] = nearest[foot]
    return expected


def fit_closest(
    body: ModelSamples,
    pose: Pose,
    prior: Prior,
    scan: PreparedScan,
    scales: tuple[float, ...],
    *,
    with_detail: bool = True,
) -> Pose:
    """Return the parameters that bring a body's points to the closest points of a scan.

    With detail, gaps that skin would explain move no joint in the last steps.
    """
    for scale in scales:
        posed = pose_body(body, pose)
        gaps, normals, weights, *_ = scan.match(posed.points, posed.normals, scale)
        shares = body.areas * weights
        equations = normal_equations(
            posed,
            prior,
            scan.prior_weight,
            shares,
            gaps,
            normals,
            DENSE_ALONG,
            with_detail=with_detail and scale <= DENSE_SCALES[-1],
        )
        pose = take_step(posed, equations, LONGEST_ROTATION)
    return pose


def fit_again(task: DenseTask, limb: LimbFit) -> tuple[DenseTask, Pose]:
    """Return the whole body fitted from one with another limb, and the task with its prior."""
    task = replace(task, prior=limb.prior)
    return task, fit_closest(task.samples, limb.pose, limb.prior, task.scan, DENSE_SCALES)


def fit_joints(
    task: DenseTask,
    joints: Integers,
    samples: ModelSamples,
    scales: tuple[float, ...],
    start: Pose,
) -> Pose:
    """Fit some joints and the hands to the scan by points on them; hold everything else."""
    model, prior = task.body.model, task.prior
    moving = np.isin(np.arange(model.n_joints), joints)
    of_hands = np.arange(len(start.betas)) >= model.n_betas
    of_limb = Prior(
        np.where(moving[:, np.newaxis, np.newaxis], prior.local, start.local),
        np.where(moving, prior.precisions, _FIXED),
        np.where(of_hands, prior.betas, start.betas),
        np.where(of_hands, prior.betas_precisions, _FIXED),
    )
    samples = samples._replace(areas=samples.areas * task.visible[samples.numbers])
    return fit_closest(samples, start, of_limb, task.scan, scales, with_detail=False)


def is_clearly_refused(body: RegistrationModel, pose: Pose, points: Array, near: float) -> bool:
    """Return whether too many of a scan's points are far from a body for details to matter."""
    some = points[even_points(points, N_NEAR)]
    _, gaps = nearest_points(some, body.surface(pose), body.model.faces)
    return bool(np.mean(gaps < near) < CLEARLY_NEAR)


def find_hair(body: RegistrationModel, surface: Array, points: Array) -> Booleans:
    """Return which points of a scan lie so far outside the head that they are hair or a hat."""
    parts, faces = body.parts, body.model.faces
    on_head = np.isin(parts.owners, parts.numbers("head", "neck"))
    hair = np.zeros(len(points), dtype=bool)
    head = surface[on_head]
    if not len(head):
        return hair
    low, high = head.min(axis=0) - FARTHEST_HAIR, head.max(axis=0) + FARTHEST_HAIR
    around = np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
    # Points near a vertex are near the surface.
    around = around[cKDTree(surface).query(points[around])[0] > MATCHED_METRES]
    if not len(around):
        return hair
    places, gaps = nearest_points(points[around], surface, faces)
    near = faces[places.triangles, places.barycentric.argmax(axis=1)]
    normals = vertex_normals(surface, faces)[near]
    heights = np.einsum("nx,nx->n", points[around] - surface[near], normals)
    far = (gaps > MATCHED_METRES) & (gaps < FARTHEST_HAIR) & (heights > 0.0)
    hair[around[far & on_head[near]]] = True
    return hair if hair.mean() < MOST_HAIR else np.zeros_like(hair)
