"""A body model as registration uses it; what depends only on the model is computed once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from riemhuman.arrays import Array, Booleans, Integers
from riemhuman.bodies import BodyModel
from riemhuman.bodies.skinning import JointMotions
from riemhuman.errors import ArgumentError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.registration._constants import (
    SEARCH_ROUNDS,
    STILL_HANDS,
)
from riemhuman.registration._limbs import ArmSurface, BodyParts, make_arm_surface
from riemhuman.registration._posed_body import ModelSamples, Pose, Prior, pose_body, sample_model
from riemhuman.registration._start_poses import joint_precisions, start_poses
from riemhuman.registration.registration_settings import DEFAULT_SETTINGS, RegistrationSettings


class End(NamedTuple):
    """A plane beyond which a scan shows nothing of a body."""

    direction: Array  # (3,) away from the scan
    height: float  # along the direction, metres

    def shows(self, points: Array, distance: float = 0.0) -> Booleans:
        """Return which points are at least this far before the plane, metres."""
        shown: Booleans = points @ self.direction <= self.height - distance
        return shown


@dataclass(frozen=True, eq=False)
class RegistrationModel:
    """A body model with the settings of its registration."""

    model: BodyModel
    settings: RegistrationSettings = DEFAULT_SETTINGS
    cut: int = 0  # -1 for a body without legs, 1 for one without all above the waist

    @cached_property
    def parts(self) -> BodyParts:
        return BodyParts(self.model)

    @cached_property
    def halves(self) -> list[RegistrationModel]:
        """The body without its legs and without all above the waist, if the model names them."""
        return [replace(self, cut=cut) for cut in (-1, 1)] if self.parts.halves else []

    @cached_property
    def root(self) -> int:
        return int(np.flatnonzero(self.model.parents < 0)[0])

    @cached_property
    def arms(self) -> list[Integers]:
        """The joints of the arms for which other poses are tried."""
        return self.parts.arms if self.settings.tries_arms else []

    @cached_property
    def arm_surfaces(self) -> list[ArmSurface]:
        parts = self.parts
        skin, few = self.samples(None), self.samples(SEARCH_ROUNDS[-1].n_model)
        return [make_arm_surface(parts, joints, skin, few) for joints in self.arms]

    @cached_property
    def poses(self) -> dict[str, Array]:
        """The start poses, rotations of the joints."""
        poses, chosen = start_poses(self.model), self.settings.poses
        if chosen is None:
            return poses
        if not chosen or not set(chosen) <= set(poses):
            raise ArgumentError(
                f"settings.poses has {', '.join(chosen) or 'none'}; the model has "
                f"{', '.join(poses)}"
            )
        return {name: poses[name] for name in chosen}

    @cached_property
    def precisions(self) -> Array:
        """Inverse variances of the joints' rotations from a start pose."""
        return joint_precisions(self.model)

    @cached_property
    def betas_precisions(self) -> Array:
        """Inverse variances of the coefficients; hands stay relaxed until the dense fit."""
        counts = [self.model.n_betas, self.model.hand_directions.shape[2]]
        return np.repeat([1.0, STILL_HANDS], counts)

    @cached_property
    def metric(self) -> ElasticMetric:
        return ElasticMetric(AlignedSurfaces(self.model.template), a=1.0, lam=1.0, c=1.0)

    @cached_property
    def _shown(self) -> Booleans:
        """Which vertices belong to the body, without its legs if they are cut off."""
        if self.cut < 0:
            return ~self.parts.halves[0]
        return np.ones(self.model.n_vertices, dtype=bool)

    @cached_property
    def _samples(self) -> dict[int | None, ModelSamples]:
        return {}

    def samples(self, n_samples: int | None) -> ModelSamples:
        """Return about this number of points of the model, all by None; computed once."""
        if n_samples not in self._samples:
            self._samples[n_samples] = sample_model(self.model, n_samples).showing(self._shown)
        return self._samples[n_samples]

    def surface(self, pose: Pose) -> Array:
        return pose_body(self.samples(None), pose).points[: self.model.n_vertices]

    def joint_motions(self, pose: Pose) -> JointMotions:
        """Return rotations and positions of the joints before the translation of a pose."""
        return JointMotions(self.samples(None).skeleton, pose.local, pose.betas)

    def prior(self, pose: Pose) -> Prior:
        """Return the prior of a search around a pose."""
        return Prior(pose.local, self.precisions, pose.betas, self.betas_precisions)

    def end_of(self, scan: Array, up: Array) -> End | None:
        """Return where a scan of a part of a body ends."""
        direction = self.cut * up
        return End(direction, float((scan @ direction).max())) if self.cut else None

    def find_visible(self, surface: Array, scan: Array, up: Array) -> Booleans:
        """Return which vertices a scan can show."""
        end = self.end_of(scan, up)
        return self._shown if end is None else self._shown & end.shows(surface)
