"""Files: meshes, points, arrays, pickled body models and the folders of jobs.

Reading a file never runs code, and takes only a small multiple of the memory that its content
needs. A killed process leaves no partial files, and two processes may share the folder of a job.
"""

from riemhuman.io._gltf import save_glb
from riemhuman.io.arrays import load_array, load_arrays, save_arrays
from riemhuman.io.kinds_of_files import FileKind, file_kinds, reads
from riemhuman.io.mesh_seams import Seams, find_seams
from riemhuman.io.meshes import (
    as_arrays,
    is_registered_scan,
    load_mesh,
    load_points,
    load_trusted,
    save_mesh,
    to_pyvista,
    to_trimesh,
)
from riemhuman.io.pickles import load_pickled_arrays

__all__ = [
    "FileKind",
    "Seams",
    "as_arrays",
    "file_kinds",
    "find_seams",
    "is_registered_scan",
    "load_array",
    "load_arrays",
    "load_mesh",
    "load_pickled_arrays",
    "load_points",
    "load_trusted",
    "reads",
    "save_arrays",
    "save_glb",
    "save_mesh",
    "to_pyvista",
    "to_trimesh",
]


def __dir__() -> list[str]:
    return sorted(__all__)
