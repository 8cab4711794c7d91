"""Animated skeletons of GLB files, which Blender and game engines write, as recordings."""

from __future__ import annotations

from pathlib import Path

from riemhuman.io.files import format_errors, read_bytes
from riemhuman.io.gltf_animation import read_animation
from riemhuman.mocap.skeleton_motion import SkeletonMotion


def load_animation(file: Path) -> SkeletonMotion:
    """Return the skeleton of a GLB file and its first animation, metres, y up."""
    with format_errors(file, "an animated skeleton"):
        motion = read_animation(read_bytes(file))
        return SkeletonMotion(
            motion.names,
            motion.parents,
            motion.rest,
            motion.rotations,
            motion.translations,
            motion.frames_per_second,
            file.stem,
            "metres",
            has_rest_pose=motion.is_rest,
        )
