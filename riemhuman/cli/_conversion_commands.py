"""The commands ``make-map`` and ``convert``: between files, and between topologies."""

from __future__ import annotations

import argparse
from pathlib import Path

import riemhuman as rh
from riemhuman.cli import _commands as cli
from riemhuman.cli import _inputs as inputs
from riemhuman.errors import ArgumentError

_MESHES = (".ply", ".obj", ".off", ".stl", ".glb")
_MOTIONS = (".npz", ".bvh", ".glb")


@cli.command(
    "make-map",
    "a map between a topology and the open model",
    "Registers the open model to a body of another topology, in any pose, and writes where the\n"
    "vertices of each are on the other. `riemhuman convert --map` applies the map.",
    "  riemhuman make-map smpl_body.ply -o smpl_map.npz\n"
    "  riemhuman make-map smpl_body.ply -o smpl_map.npz --coarse\n",
    cli.mesh_option("body", "BODY", "a body of the other topology, metres"),
    cli.output("NPZ", ".npz"),
    cli.flag("--coarse", "a map to the coarse model"),
)
def _make_map(options: argparse.Namespace) -> cli.Answer:
    model = rh.datasets.load_open_model("coarse" if options.coarse else "full")
    with options.task("Map"):
        topology = rh.registration.TopologyMap.fit(options.body, model)
        topology.save(options.output)
    record = {
        "vertices": topology.n_template_vertices,
        "model_vertices": model.n_vertices,
        "without_counterpart": [*topology.template_parts],
        "of_the_model_without_counterpart": [*topology.model_parts],
    }
    return cli.Answer(record, record)


@cli.command(
    "convert",
    "a body or a motion in another format or topology",
    "Reads a mesh, a body of SAM 3D Body (.npz, with --faces), or a recording of a motion, and\n"
    "writes it in another format. With a map of `riemhuman make-map`, a body of either topology\n"
    "becomes one of the other.",
    "  riemhuman convert scan.obj -o scan.ply\n"
    "  riemhuman convert smpl_body.ply -o open_body.ply --map smpl_map.npz\n"
    "  riemhuman convert photograph.npz -o body.ply --faces mhr_face_mask.ply\n"
    "  riemhuman convert walk.bvh -o walk.npz\n",
    cli.path_option("source", "FILE", "a mesh, a body of SAM 3D Body, or a recording"),
    cli.output("FILE", *dict.fromkeys((*_MESHES, *_MOTIONS))),
    cli.path_option("--map", "MAP", "a map of `riemhuman make-map`"),
    cli.path_option("--faces", "MESH", "mesh with the triangles of SAM 3D Body"),
)
def _convert(options: argparse.Namespace) -> cli.Answer:
    source: Path = options.source
    is_motion = options.faces is None and source.suffix.lower() not in _MESHES
    with options.task("Converting"):
        if is_motion and inputs.is_recording(source):
            return _convert_motion(options)
        if options.ending not in _MESHES:
            raise ArgumentError(
                f"{options.output} must be a mesh ({', '.join(_MESHES)}): {source} holds a body"
            )
        if options.faces is not None:
            photographs = rh.datasets.load_photographed_bodies(source, options.faces)
            points, faces = photographs.points[0], photographs.faces
        else:
            points, faces = rh.load_mesh(source)
        if options.map is not None:
            topology = rh.registration.TopologyMap.load(options.map)
            if len(points) == topology.model.n_vertices:
                points = topology.to_template((points, faces))
                faces = topology.template_faces
            else:
                points = topology.to_model((points, faces))
                faces = topology.model.faces
        rh.save_mesh(options.output, points, faces)
    record = {"vertices": len(points), "triangles": len(faces)}
    return cli.Answer(record, record)


def _convert_motion(options: argparse.Namespace) -> cli.Answer:
    if options.map is not None:
        raise ArgumentError("--map is for bodies; a recording is performed by the open model")
    if options.ending not in _MOTIONS:
        raise ArgumentError(
            f"{options.output} must be a motion ({', '.join(_MOTIONS)}): {options.source} holds one"
        )
    motion = rh.datasets.load_recording(options.source)
    motion.save(options.output)
    record = {"frames": len(motion), "frames_per_second": motion.frames_per_second}
    return cli.Answer(record, record)
