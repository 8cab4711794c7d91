"""Descriptors: vectors that represent a surface, for comparison with the metrics."""

from riemhuman.descriptors.area_projection import AreaProjectionTransform, ProjectedAreas
from riemhuman.descriptors.descriptor import Descriptor
from riemhuman.descriptors.latent_vectors import LatentVectors
from riemhuman.descriptors.model_vectors import ModelPoseVectors, ModelShapeVectors
from riemhuman.descriptors.spectral_descriptors import (
    HeatKernelSignature,
    ShapeDNA,
    WaveKernelSignature,
)

__all__ = [
    "AreaProjectionTransform",
    "Descriptor",
    "HeatKernelSignature",
    "LatentVectors",
    "ModelPoseVectors",
    "ModelShapeVectors",
    "ProjectedAreas",
    "ShapeDNA",
    "WaveKernelSignature",
]


def __dir__() -> list[str]:
    return sorted(__all__)
