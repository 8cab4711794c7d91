"""Files: meshes, arrays, pickled body models and the folders of jobs.

Threat model: files come from colleagues and the web. Reading one never runs code, never writes
outside memory that it owns, and takes memory of a small multiple of what its content needs. A
killed process leaves whole files, and two processes may share the folder of a job, on one machine
or over NFS. A hostile local user with write access to one's folders is out of scope.
"""

from riemhuman.io.arrays import load_array, load_arrays, save_arrays
from riemhuman.io.gltf import save_glb
from riemhuman.io.meshes import (
    as_arrays,
    from_pyvista,
    from_trimesh,
    load_mesh,
    load_with_meshio,
    save_mesh,
    to_pyvista,
    to_trimesh,
)
from riemhuman.io.pickles import load_pickled_arrays

__all__ = [
    "as_arrays",
    "from_pyvista",
    "from_trimesh",
    "load_array",
    "load_arrays",
    "load_mesh",
    "load_pickled_arrays",
    "load_with_meshio",
    "save_arrays",
    "save_glb",
    "save_mesh",
    "to_pyvista",
    "to_trimesh",
]


def __dir__() -> list[str]:
    return sorted(__all__)
