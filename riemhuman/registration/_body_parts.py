"""The parts of a body model by the usual names of its joints: which vertices each moves."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from riemhuman.arrays import Array, Booleans, Integers
from riemhuman.bodies import BodyModel
from riemhuman.bodies.skinning import usual_joint_names

_ARM_JOINTS = ("collar", "shoulder", "elbow", "wrist")
# Joints that move a smaller share of the model's vertices are ignored.
_LIMB = 0.01


@dataclass(frozen=True, eq=False)
class BodyParts:
    """The joints of a model by their usual names, and the vertices that each moves most."""

    model: BodyModel

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Return the usual names of the joints."""
        return usual_joint_names(self.model)

    @cached_property
    def owners(self) -> Integers:
        """Return the joint that moves each vertex most."""
        owners: Integers = self.model.weights.argmax(axis=1)
        return owners

    @cached_property
    def arms(self) -> list[Integers]:
        """Return the joints of each arm, from the collar to the wrist."""
        arms = [[f"{side}_{joint}" for joint in _ARM_JOINTS] for side in ("left", "right")]
        return [np.array(self.numbers(*arm)) for arm in arms if {*arm} <= {*self.names}]

    @cached_property
    def on_hands(self) -> Booleans:
        """Return which vertices belong to the hands."""
        return self.vertices(int(arm[-1]) for arm in self.arms)

    @cached_property
    def halves(self) -> list[Booleans]:
        """Return which vertices are of the legs, and which above the waist."""
        if not {"left_hip", "right_hip", "middle_spine"} <= {*self.names}:
            return []
        ends = (("left_hip", "right_hip"), ("middle_spine",))
        return [self.vertices(self.numbers(*names)) for names in ends]

    def numbers(self, *names: str) -> list[int]:
        """Return the joints with these names that the model has."""
        return [self.names.index(name) for name in names if name in self.names]

    def vertices(self, joints: Iterable[int]) -> Booleans:
        """Return which vertices belong to some joints or to joints below them."""
        below = {*joints}
        for k in map(int, self.model.joint_order):
            if int(self.model.parents[k]) in below:
                below.add(k)
        return np.isin(self.owners, sorted(below))

    def limb_vertices(self, joint: int) -> Booleans:
        """Return which vertices belong to a joint or to those below it, or above it on an arm."""
        joints = [joint]
        for arm in self.arms:
            joints += arm[1:].tolist() if joint in arm[1:] else []
        return self.vertices(joints)

    def shares(self, chosen: Booleans) -> Array:
        """Return the share of the vertices of each joint that are chosen; 1 for small joints."""
        counts = np.bincount(self.owners, minlength=self.model.n_joints)
        chosen_counts = np.bincount(self.owners, chosen, minlength=self.model.n_joints)
        return np.where(counts >= _LIMB * len(chosen), chosen_counts / np.maximum(counts, 1), 1.0)
