"""Registered surfaces: the template, mesh files and rigid alignment."""

from riemhuman.surfaces.deformation_basis import DeformationBasis
from riemhuman.surfaces.gltf_files import save_glb
from riemhuman.surfaces.mesh_files import load_mesh, save_mesh
from riemhuman.surfaces.mesh_objects import load_with_meshio
from riemhuman.surfaces.procrustes import generalized_procrustes, procrustes
from riemhuman.surfaces.template import Template

__all__ = [
    "DeformationBasis",
    "Template",
    "generalized_procrustes",
    "load_mesh",
    "load_with_meshio",
    "procrustes",
    "save_glb",
    "save_mesh",
]


def __dir__() -> list[str]:
    return sorted(__all__)
