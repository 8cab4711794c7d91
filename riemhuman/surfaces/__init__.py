"""Registered surfaces: the template, deformation bases and Procrustes alignment."""

from riemhuman.surfaces.deformation_basis import DeformationBasis
from riemhuman.surfaces.procrustes import generalized_procrustes, procrustes
from riemhuman.surfaces.spectra import Spectrum, spectrum
from riemhuman.surfaces.template import Template

__all__ = [
    "DeformationBasis",
    "Spectrum",
    "Template",
    "generalized_procrustes",
    "procrustes",
    "spectrum",
]


def __dir__() -> list[str]:
    return sorted(__all__)
