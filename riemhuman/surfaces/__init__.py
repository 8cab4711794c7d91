"""Registered surfaces: the template, deformation bases, alignment, spectra and measures."""

from riemhuman.surfaces.deformation_basis import DeformationBasis
from riemhuman.surfaces.measures import (
    edge_lengths,
    is_closed,
    signed_volume,
    triangle_areas,
)
from riemhuman.surfaces.nearest_points import SurfacePoints, nearest_points
from riemhuman.surfaces.procrustes import generalized_procrustes, make_upright, procrustes
from riemhuman.surfaces.spectra import Spectrum, spectrum
from riemhuman.surfaces.template import Template

__all__ = [
    "DeformationBasis",
    "Spectrum",
    "SurfacePoints",
    "Template",
    "edge_lengths",
    "generalized_procrustes",
    "is_closed",
    "make_upright",
    "nearest_points",
    "procrustes",
    "signed_volume",
    "spectrum",
    "triangle_areas",
]


def __dir__() -> list[str]:
    return sorted(__all__)
