"""Skeletons that move, in GLB files: the nodes of an animation and their motions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from riemhuman.arrays import Array, Integers, JSONRecord, Values
from riemhuman.errors import FileFormatError
from riemhuman.io._gltf_reader import _check_extensions, _chunks, _Reader

_WIDTHS = {"translation": "VEC3", "rotation": "VEC4", "scale": "VEC3"}
# Shorter steps in time, seconds, and more frames are damage.
_SHORTEST_STEP, _MOST_FRAMES = 1e-5, 10_000_000


class NodeMotion(NamedTuple):
    """Nodes of a scene over time, parents first: rotations and translations of each in its parent.

    Scales are included in the translations; `is_rest` says that no node is rotated at rest.
    """

    names: tuple[str, ...]
    parents: Integers
    rest: Array  # (J, 3)
    rotations: Array  # (n_frames, J, 3, 3)
    translations: Array  # (n_frames, J, 3)
    frames_per_second: float
    is_rest: bool


def has_animation(content: bytes) -> bool:
    """Return whether a GLB file holds a skeleton that moves."""
    document, _ = _chunks(content)
    return bool(document.get("animations")) and bool(document.get("skins"))


def read_animation(content: bytes) -> NodeMotion:
    """Return the skeleton of a GLB file and its first animation."""
    document, binary = _chunks(content)
    _check_extensions(document)
    if not document.get("animations"):
        raise FileFormatError("it holds no animation")
    return _AnimationReader(document, binary).motion()


class _AnimationReader(_Reader):
    """Reads curves of nodes, at the frames of the animation."""

    def motion(self) -> NodeMotion:
        nodes = self._skeleton()
        channels = self._channels()
        times = self._times(channels)
        rate = (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 else 1.0
        frames = np.linspace(times[0], times[-1], len(times))
        numbers = {node: number for number, node in enumerate(nodes)}
        rotations = np.empty((len(frames), len(nodes), 3, 3))
        translations = np.empty((len(frames), len(nodes), 3))
        rest = np.empty((len(nodes), 3))
        scales = np.ones(len(nodes))
        is_rest = True
        for number, node in enumerate(nodes):
            place, turn, scale = _local_parts(self._item("nodes", node))
            parent = self._parents.get(node, -1)
            above = scales[numbers[parent]] if parent in numbers else 1.0
            scales[number] = above * scale
            rest[number] = above * place
            is_rest &= bool(np.allclose(turn.as_matrix(), np.eye(3), atol=1e-6))
            curve = channels.get((node, "translation"))
            places = np.tile(place, (len(frames), 1)) if curve is None else _linear(curve, frames)
            translations[:, number] = above * places
            curve = channels.get((node, "rotation"))
            turns = turn.as_matrix() if curve is None else _spherical(curve, frames)
            rotations[:, number] = turns
        labels = [str(self._item("nodes", node).get("name", f"node {node}")) for node in nodes]
        parents = np.array([numbers.get(self._parents.get(node, -1), -1) for node in nodes])
        return NodeMotion(
            _distinct(labels), parents, rest, rotations, translations, float(rate), is_rest
        )

    def _skeleton(self) -> list[int]:
        """Return the joints of the first skin and the nodes above them, parents first."""
        skins = self._document.get("skins", ())
        joints = skins[0].get("joints", ()) if skins else range(len(self._document["nodes"]))
        for joint in joints:
            self._item("nodes", joint)
        chosen = set().union(*(self._way(joint) for joint in joints))
        return sorted(chosen, key=lambda node: (len(self._way(node)), node))

    def _channels(self) -> dict[tuple[int, str], tuple[Array, Array]]:
        """Return times and values by node and path."""
        animation = self._document["animations"][0]
        samplers = animation.get("samplers", ())
        curves: dict[tuple[int, str], tuple[Array, Array]] = {}
        for number, channel in enumerate(animation.get("channels", ())):
            where = f"channel {number}"
            target = channel.get("target", {})
            path, sampler = target.get("path"), channel.get("sampler")
            if path not in _WIDTHS or "node" not in target:
                continue
            source: JSONRecord = samplers[sampler]
            times = self._accessor(source.get("input"), "SCALAR", where)[:, 0]
            values = self._accessor(source.get("output"), _WIDTHS[path], where)
            if source.get("interpolation") == "CUBICSPLINE":
                values = values[1::3]  # between tangents
            if not len(times) or len(values) != len(times) or (np.diff(times) <= 0.0).any():
                raise FileFormatError(
                    f"{where}: {len(times)} rising times for {len(values)} values"
                )
            curves[int(target["node"]), path] = (times, values)
        if not curves:
            raise FileFormatError("its animation moves no node")
        return curves

    def _times(self, channels: dict[tuple[int, str], tuple[Array, Array]]) -> Array:
        """Return evenly spaced times, with the smallest usual step between keys."""
        first = min(times[0] for times, _ in channels.values())
        last = max(times[-1] for times, _ in channels.values())
        steps = [np.median(np.diff(times)) for times, _ in channels.values() if len(times) > 1]
        if not steps:
            return np.array([first])
        step = max(float(min(steps)), _SHORTEST_STEP)
        count = min(round((last - first) / step) + 1, _MOST_FRAMES, 64 * self._n_bytes)
        return np.linspace(first, last, max(count, 1))


def _local_parts(node: JSONRecord) -> tuple[Values, Rotation, float]:
    """Return the translation, the rotation and the scale of a node at rest."""
    if "matrix" in node:
        matrix = np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
        scale = float(np.cbrt(abs(np.linalg.det(matrix[:3, :3])))) or 1.0
        return matrix[:3, 3], Rotation.from_matrix(matrix[:3, :3] / scale), scale
    place = np.array(node.get("translation", (0.0, 0.0, 0.0)), dtype=np.float64)
    turn = Rotation.from_quat(node.get("rotation", (0.0, 0.0, 0.0, 1.0)))
    return place, turn, float(np.mean(node.get("scale", 1.0)))


def _linear(curve: tuple[Array, Array], frames: Array) -> Array:
    times, values = curve
    return np.stack([np.interp(frames, times, column) for column in values.T], axis=1)


def _spherical(curve: tuple[Array, Array], frames: Array) -> Array:
    times, values = curve
    rotations = Rotation.from_quat(values)
    if len(times) == 1:
        return np.asarray(np.tile(rotations.as_matrix(), (len(frames), 1, 1)))
    within = np.clip(frames, times[0], times[-1])
    return np.asarray(Slerp(times, rotations)(within).as_matrix())


def _distinct(names: list[str]) -> tuple[str, ...]:
    """Return names, of which no two are equal."""
    seen: dict[str, int] = {}
    distinct = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        distinct.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return tuple(distinct)
