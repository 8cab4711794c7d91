"""Registered surfaces: the template, mesh files and rigid alignment."""

from riemhuman.surfaces.deformation_basis import DeformationBasis
from riemhuman.surfaces.gltf_files import save_glb
from riemhuman.surfaces.mesh_files import load_mesh, save_mesh
from riemhuman.surfaces.procrustes import generalized_procrustes, procrustes
from riemhuman.surfaces.template import Template

__all__ = [
    "DeformationBasis",
    "Template",
    "generalized_procrustes",
    "load_mesh",
    "procrustes",
    "save_glb",
    "save_mesh",
]
