"""The verb ``info``: the kind, size and defects of a file."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from riemhuman.cli.inputs import path_argument
from riemhuman.cli.terminal import say, say_json
from riemhuman.cli.verbs import Verbs, add_json, add_verb
from riemhuman.errors import FileError, FileFormatError

if TYPE_CHECKING:
    from numpy import ndarray

_HDF5_ENDINGS = (".hdf5", ".h5")
_PICKLE_ENDINGS = (".pkl", ".pickle")


def add_verbs(verbs: Verbs) -> None:
    """Declare ``info``.

    Parameters
    ----------
    verbs : argparse action
        The parser's verbs.
    """
    parser = add_verb(
        verbs,
        "info",
        _info,
        "the kind, size and defects of a file",
        "Describes a mesh (PLY, OBJ, OFF), a folder of meshes, an .npz file (basis, body model,\n"
        "distance matrix, path or other arrays), an SMPL model's pickle (without running it) or\n"
        "an HDF5 file of Dynamic FAUST.",
        "  riemhuman info scan.ply            # closed? degenerate triangles? which unit?\n"
        "  riemhuman info scans/              # do they share one triangulation?\n"
        "  riemhuman info basis.npz --json\n",
    )
    parser.add_argument("file", metavar="FILE", type=path_argument, help="file or folder")
    add_json(parser)


def _info(options: argparse.Namespace) -> None:
    facts = {"file": str(options.file), **_facts(options.file)}
    if options.json:
        say_json(facts)
        return
    width = max(map(len, facts))
    for name, value in facts.items():
        lines = value if isinstance(value, list) and len(value) > 4 else [_readable(value)]
        for line in lines:
            say(f"{name.replace('_', ' '):<{width}}  {line}")
            name = ""


def _readable(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return f"{value:,}"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        return ", ".join(map(_readable, value))
    return "-" if value is None else str(value)


def _facts(path: Path) -> dict[str, Any]:
    from riemhuman.datasets.registered_meshes import MESH_ENDINGS

    ending = path.suffix.lower()
    if not path.exists():
        raise FileError(f"there is no file or folder {path}")
    if path.is_dir():
        return _folder_facts(path)
    if ending in MESH_ENDINGS:
        return _mesh_facts(path)
    if ending == ".npz":
        return _npz_facts(path)
    if ending in _HDF5_ENDINGS:
        return _hdf5_facts(path)
    if ending in _PICKLE_ENDINGS:
        return _model_facts(path)
    known = (*MESH_ENDINGS, ".npz", *_HDF5_ENDINGS, *_PICKLE_ENDINGS)
    raise FileFormatError(f"{path}: the ending must be one of {', '.join(known)}, or a folder")


def _mesh_facts(path: Path) -> dict[str, Any]:
    from riemhuman.cli.mesh_facts import mesh_facts
    from riemhuman.io.meshes import load_mesh

    return {"kind": "mesh", **mesh_facts(*load_mesh(path))}


def _folder_facts(path: Path) -> dict[str, Any]:
    from riemhuman.datasets import RegisteredMeshes, find_meshes

    files = find_meshes(path)
    facts: dict[str, Any] = {"kind": "folder of meshes", "meshes": len(files)}
    facts |= {"first": files[0].name, "last": files[-1].name}
    try:
        meshes = RegisteredMeshes(files)
        points, faces = meshes[:], meshes.faces
    except FileFormatError as error:
        return facts | {"registered": f"no: {error}"}
    extents = (points.max(axis=1) - points.min(axis=1)).max(axis=0).tolist()
    return facts | {
        "registered": True,
        "vertices": points.shape[1],
        "triangles": len(faces),
        "largest_extents": extents,
    }


def _npz_facts(path: Path) -> dict[str, Any]:
    from riemhuman.io.arrays import load_arrays

    arrays = load_arrays(path, ())
    if {"vectors", "format_version"} <= arrays.keys():
        return _basis_facts(path)
    if {"v_template", "shapedirs"} <= arrays.keys():
        return _model_facts(path)
    if {"distances", "names"} <= arrays.keys():
        return _matrix_facts(arrays)
    if {"path", "faces"} <= arrays.keys() and arrays["path"].ndim == 3:
        n_times, n_vertices = arrays["path"].shape[:2]
        n_triangles = len(arrays["faces"])
        return {"kind": "path", "times": n_times, "vertices": n_vertices, "triangles": n_triangles}
    listed = {name: f"{array.dtype} {array.shape}" for name, array in arrays.items()}
    return {"kind": "arrays", **listed}


def _basis_facts(path: Path) -> dict[str, Any]:
    from riemhuman.surfaces.deformation_basis import DeformationBasis

    basis = DeformationBasis.load(path)
    ratio = basis.explained_variance_ratio
    return {
        "kind": "basis of deformations",
        "deformations": basis.n_components,
        "vertices": basis.n_vertices,
        "orthonormal": True,
        "explained_variance": None if ratio is None else float(ratio.sum()),
    }


def _model_facts(path: Path) -> dict[str, Any]:
    from riemhuman.bodies import BodyModel

    model = BodyModel.from_file(path)
    return {
        "kind": "body model",
        "vertices": model.n_vertices,
        "triangles": len(model.faces),
        "joints": model.n_joints,
        "shape_coefficients": model.n_betas,
        "pose_blend_shapes": model.posedirs is not None,
        "joint_names": ", ".join(model.joint_names),
    }


def _matrix_facts(arrays: Mapping[str, ndarray]) -> dict[str, Any]:
    import numpy as np

    distances = arrays["distances"]
    square = distances.ndim == 2 and distances.shape[0] == distances.shape[1]
    others = distances[~np.eye(len(distances), dtype=bool)] if square else distances.ravel()
    return {
        "kind": "distance matrix",
        "shape": list(distances.shape),
        "names": len(arrays["names"]),
        "metric": str(arrays["metric"]) if "metric" in arrays else None,
        "symmetric": bool(square and np.array_equal(distances, distances.T)),
        "zero_diagonal": bool(square and not distances.diagonal().any()),
        "finite": bool(np.isfinite(distances).all()),
        "smallest": float(others.min()) if others.size else None,
        "largest": float(others.max()) if others.size else None,
    }


def _hdf5_facts(path: Path) -> dict[str, Any]:
    from riemhuman.datasets import load_dfaust

    motions = load_dfaust(path)
    return {
        "kind": "motions of Dynamic FAUST",
        "motions": len(motions),
        "people": sorted({motion.subject for motion in motions}),
        "frames": sum(len(motion) for motion in motions),
        "vertices": int(motions[0].faces.max()) + 1,
        "triangles": len(motions[0].faces),
        "sequences": [f"{m.subject}_{m.sequence}: {len(m):,} frames" for m in motions],
    }
