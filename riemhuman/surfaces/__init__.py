"""Registered surfaces: the template, mesh files, deformation bases and Procrustes alignment."""

from riemhuman.surfaces.deformation_basis import DeformationBasis
from riemhuman.surfaces.gltf_files import save_glb
from riemhuman.surfaces.mesh_files import load_mesh, save_mesh
from riemhuman.surfaces.mesh_objects import (
    from_pyvista,
    from_trimesh,
    load_with_meshio,
    to_pyvista,
    to_trimesh,
)
from riemhuman.surfaces.procrustes import generalized_procrustes, procrustes
from riemhuman.surfaces.spectra import Spectrum, spectrum
from riemhuman.surfaces.template import Template

__all__ = [
    "DeformationBasis",
    "Spectrum",
    "Template",
    "from_pyvista",
    "from_trimesh",
    "generalized_procrustes",
    "load_mesh",
    "load_with_meshio",
    "procrustes",
    "save_glb",
    "save_mesh",
    "spectrum",
    "to_pyvista",
    "to_trimesh",
]


def __dir__() -> list[str]:
    return sorted(__all__)
