"""The commands ``make-map`` and ``convert``: between files, and between topologies."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import riemhuman as rh
from riemhuman.cli import _commands as cli
from riemhuman.cli import _inputs as inputs
from riemhuman.errors import ArgumentError

if TYPE_CHECKING:
    from riemhuman.arrays import Points, Triangles
    from riemhuman.mocap.motions import ModelMotion

_MESHES = (".ply", ".obj", ".off", ".stl", ".glb")
_WRITTEN_MESHES = (".ply", ".obj", ".off", ".glb")
_MOTIONS = (".npz", ".bvh", ".glb")
_RATE_OF_VIDEOS = 30.0
# Written from bodies only if they are frames of a motion; .glb may be a mesh.
_SKELETAL = (".npz", ".bvh")
_FOLDER_FILES = r"(?is:.+\.ply)|summary\.json"


@cli.command(
    "make-map",
    "Registers the open model to a body of another topology, in any pose. The map that it\n"
    "writes says where the vertices of each mesh lie on the other. `riemhuman convert --map`\n"
    "applies the map.",
    "  riemhuman make-map smpl_body.ply -o smpl_map.npz\n"
    "  riemhuman make-map smpl_body.ply -o smpl_map.npz --coarse --up z\n",
    cli.mesh_option("body", "BODY", "a body of the other topology, in metres"),
    cli.output("NPZ", ".npz"),
    cli.flag("--coarse", "a map to the coarse model"),
    cli.option("--up", "axis that points up (default: found by the feet)", choices=cli.AXES),
)
def _make_map(options: argparse.Namespace) -> cli.Answer:
    model = rh.datasets.load_open_model("coarse" if options.coarse else "full")
    with options.task("Map"):
        topology = rh.topologies.TopologyMap.fit(options.body, model, up=options.up)
        topology.save(options.output)
    record = {
        "vertices": topology.n_template_vertices,
        "model_vertices": model.n_vertices,
        "without_counterpart": [*topology.template_parts],
        "of_the_model_without_counterpart": [*topology.model_parts],
    }
    return cli.Answer(record, record)


def _target(parser: argparse._ActionsContainer) -> None:
    """Declare the output as a second place, for ``convert IN OUT``."""
    parser.add_argument("target", metavar="OUT", nargs="?", help="the output, instead of -o")

    def check(options: argparse.Namespace) -> None:
        if (options.target is None) == (options.output is None):
            raise ArgumentError("give one output: `riemhuman convert IN OUT`, or -o OUT")
        options.output = options.output or options.target

    cli.checked(check)(parser)


@cli.command(
    "convert",
    "Reads a mesh, a folder of meshes, bodies of SAM 3D Body (.npz, with --faces), or a\n"
    "recording of a motion, and writes it in another format. With a map from `riemhuman\n"
    "make-map`, it converts bodies of either topology to the other. Several bodies become a\n"
    "folder of .ply files. If a recording shows several people, one of them is written, and a\n"
    "message says which. With --faces and --map, the bodies in an .npz file are treated as\n"
    "frames of one person's motion if the output is .npz or .bvh.",
    "  riemhuman convert scan.obj scan.ply\n"
    "  riemhuman convert smpl_body.ply open_body.ply --map smpl_map.npz\n"
    "  riemhuman convert photographs.npz bodies/ --faces mhr_face_mask.ply\n"
    "  riemhuman convert walk.bvh -o walk.npz\n"
    "  riemhuman convert video.npz walk.bvh --faces face_mask.ply --map map.npz --fps 30\n",
    cli.path_option("source", "IN", "a mesh, bodies of SAM 3D Body, a recording, or a folder"),
    _target,
    cli.output(
        "OUT",
        *dict.fromkeys((*_WRITTEN_MESHES, *_MOTIONS)),
        names=_FOLDER_FILES,
        always="summary.json",
        required=False,
    ),
    cli.path_option("--map", "MAP", "a map of `riemhuman make-map`"),
    cli.path_option("--faces", "MESH", "mesh with the triangles of SAM 3D Body"),
    cli.option(
        "--up",
        "axis that points up in the bodies, which are turned so that y points up",
        choices=cli.AXES,
    ),
    cli.option(
        "--fps",
        f"frame rate, for bodies that become a motion (default: {_RATE_OF_VIDEOS:g}), and for "
        "recordings that do not state it",
        metavar="N",
        type=float,
    ),
    cli.JOINTS,
)
def _convert(options: argparse.Namespace) -> cli.Answer:
    from riemhuman.io.files import format_errors

    source: Path = options.source
    is_motion = options.faces is None and source.suffix.lower() not in _MESHES
    with options.task("Converting"):
        if is_motion and not source.is_dir() and inputs.is_recording(source):
            return _convert_motion(options)
        if options.faces is not None and options.map is not None and options.ending in _SKELETAL:
            return _convert_photographs_to_motion(options)
        if options.ending not in (*_WRITTEN_MESHES, ""):
            raise ArgumentError(
                f"{options.output} must be a mesh ({', '.join(_WRITTEN_MESHES)}) or a folder: "
                f"{source} holds bodies"
            )
        bodies = _read_bodies(source, options.faces)
        if options.ending and len(bodies) > 1:
            raise ArgumentError(
                f"{source} holds {len(bodies)} bodies, and {options.output} takes one: give a "
                f"folder, such as {options.output.with_suffix('')}/"
            )
        change = _change_of_topology(options.map, options.up)
        converted = {}
        for name, body in bodies.items():
            file = source / name if source.is_dir() else source
            with format_errors(file, "a body of the map's topology"):
                converted[f"{name}.ply"] = change(*body)
        points, faces = next(iter(converted.values()))
        record = {"bodies": len(bodies), "vertices": len(points), "triangles": len(faces)}
        if options.ending:
            rh.save_mesh(options.output, points, faces)
        else:
            # A folder may hold bodies of several topologies.
            with inputs.mesh_folder(options, {}, faces, record) as folder:
                for name, (converted_points, triangles) in converted.items():
                    rh.save_mesh(folder / name, converted_points, triangles)
    return cli.Answer(record, record)


def _read_bodies(source: Path, faces: Path | None) -> dict[str, tuple[Points, Triangles]]:
    """Return the bodies in a file or a folder by name."""
    if faces is not None:
        photographed = rh.datasets.load_photographed_bodies(source, faces)
        names = photographed.names
        if len(set(names)) < len(names):
            names = tuple(f"{name}_{names[:k].count(name)}" for k, name in enumerate(names))
        bodies = zip(names, photographed.points, strict=True)
        return {name: (points, photographed.faces) for name, points in bodies}
    files = rh.datasets.find_meshes(source) if source.is_dir() else [source]
    meshes = {file.stem: rh.load_mesh(file) for file in files}
    if len(meshes) < len(files):
        raise ArgumentError(
            f"{source} holds two meshes with the same name, which would become one file"
        )
    return meshes


def _change_of_topology(
    place: Path | None,
    up: str | None,
) -> Callable[[Points, Triangles], tuple[Points, Triangles]]:
    """Return what a map makes of a body, in the direction that its number of vertices tells."""
    if place is None:
        return lambda points, faces: (rh.surfaces.make_upright(points, up=up), faces)
    topology = rh.topologies.TopologyMap.load(place)

    def change(points: Points, faces: Triangles) -> tuple[Points, Triangles]:
        if len(points) == topology.model.n_vertices:
            return topology.to_template((points, faces), up=up), topology.template_faces
        return topology.to_model((points, faces), up=up), topology.model.faces

    return change


def _convert_motion(options: argparse.Namespace) -> cli.Answer:
    if options.map is not None:
        raise ArgumentError("--map is for bodies; a recording is performed by the open model")
    if options.ending not in _MOTIONS:
        raise ArgumentError(
            f"{options.output} must be a motion ({', '.join(_MOTIONS)}): {options.source} holds one"
        )
    return _saved_motion(inputs.load_recording(options.source, options), options)


def _convert_photographs_to_motion(options: argparse.Namespace) -> cli.Answer:
    """Write the bodies in a file, seen from a camera, as a motion of the open model."""
    photographed = rh.datasets.load_photographed_bodies(options.source, options.faces)
    topology = rh.topologies.TopologyMap.load(options.map)
    rate = _RATE_OF_VIDEOS if options.fps is None else options.fps
    motion = topology.to_motion(photographed.places, rate, name=options.source.stem)
    return _saved_motion(motion, options)


def _saved_motion(motion: ModelMotion, options: argparse.Namespace) -> cli.Answer:
    motion.save(options.output)
    record = {"frames": len(motion), "frames_per_second": motion.frames_per_second}
    return cli.Answer(record, record)
