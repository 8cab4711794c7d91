"""The verbs ``transfer`` and ``disentangle``: motions and poses of one body on another."""

from __future__ import annotations

import argparse

from riemhuman.cli.inputs import (
    add_template,
    add_units,
    meshes_named,
    path_argument,
    surfaces_in,
)
from riemhuman.cli.outputs import add_folder_or_file, checked_output, write_motion
from riemhuman.cli.pictures import add_picture, check_picture, write_picture
from riemhuman.cli.terminal import Reporter, convergence, say, say_json
from riemhuman.cli.verbs import Verbs, add_json, add_output, add_verb
from riemhuman.io.outputs import check_output_file


def add_verbs(verbs: Verbs) -> None:
    """Declare ``transfer`` and ``disentangle``.

    Parameters
    ----------
    verbs : argparse action
        The parser's verbs.
    """
    parser = add_verb(
        verbs,
        "transfer",
        _transfer,
        "a motion of one body replayed on another",
        "Replays a motion, a sequence of registered meshes, on another body of the same\n"
        "triangulation. By default the body must have the pose of the first mesh; with\n"
        "--transfer pose it may have any pose. Writes a folder with the meshes frame_0000.ply,\n"
        "... and motion.html, a page that plays them. If the output ends in .glb (an animation)\n"
        "or .npz (the array path), writes only that file.",
        "  riemhuman transfer motion/ --onto ben.ply -o motion_of_ben/\n"
        "  riemhuman transfer motion/ --onto ben.ply -o motion_of_ben.glb\n"
        "  riemhuman transfer run_*.obj --onto ben.ply --axes body -o run_of_ben.npz\n"
        "  riemhuman transfer hands_on_head/ --onto ben.ply --transfer pose -o ben_too/\n",
    )
    parser.add_argument(
        "motion", metavar="FILES", nargs="+", type=path_argument, help="mesh files, or folders"
    )
    parser.add_argument(
        "--onto", required=True, metavar="MESH", type=path_argument, help="body to move"
    )
    add_folder_or_file(parser)
    parser.add_argument(
        "--axes",
        choices=("world", "body"),
        default="world",
        help="axes about which triangles turn: those of the world, or those of the body, for a "
        "body in another pose than the first mesh (default: world)",
    )
    parser.add_argument(
        "--transfer",
        choices=("change", "pose"),
        default="change",
        help="replay the changes since the first mesh, or the poses themselves (default: change)",
    )
    add_json(parser)
    add_units(parser)
    parser.set_defaults(template=None, any_scale=False, align=False)

    parser = add_verb(
        verbs,
        "disentangle",
        _disentangle,
        "a body with one mesh's shape and another's pose",
        "Brings the first mesh into the pose of the second by a smooth field of rotations, which\n"
        "keeps its detail. Then writes the body nearest to the first mesh in the shape metric,\n"
        "(a, λ, c) = (1, 1, 0), and to the posed mesh in the pose metric, (0, 0, 1).",
        "  riemhuman disentangle anna_standing.ply ben_sitting.ply -o anna_sitting.ply\n"
        "  riemhuman disentangle a.ply b.ply -o both.obj --pose-weight 50 --json\n"
        "  riemhuman disentangle a.ply b.ply -o both.ply --basis basis.npz\n",
    )
    parser.add_argument("shape", metavar="SHAPE", type=path_argument, help="mesh of the person")
    parser.add_argument("pose", metavar="POSE", type=path_argument, help="mesh of the pose")
    add_output(parser, "MESH")
    parser.add_argument(
        "--pose-weight",
        type=float,
        default=1000.0,
        metavar="W",
        help="weight of the squared pose distance relative to the shape distance (default: 1000)",
    )
    parser.add_argument(
        "--basis",
        metavar="NPZ",
        type=path_argument,
        help="deformations by which the body may differ from SHAPE, see riemhuman basis "
        "(default: all vertices are free)",
    )
    add_template(parser, "SHAPE")
    add_picture(parser)
    add_json(parser)
    parser.set_defaults(align=False)


def _transfer(options: argparse.Namespace) -> None:
    from riemhuman.geometry import AlignedSurfaces
    from riemhuman.progress import ProgressBar
    from riemhuman.solvers import MotionTransfer

    output, ending = checked_output(options)
    reporter = Reporter(options.quiet)
    files = meshes_named(options.motion)
    surfaces = surfaces_in([*files, options.onto], options)
    space = AlignedSurfaces(surfaces.template, equip=False, scale=None)
    with reporter.task(f"Transfer of {len(files)} meshes"):
        solver = MotionTransfer(options.axes, options.transfer)
        with ProgressBar(range(len(files)), disable=not reporter.bars, unit="mesh") as numbers:
            moved = solver.solve(space, (surfaces[k] for k in numbers), surfaces[len(files)])
    with reporter.task("Output"):
        meshes = f"{len(files)} meshes, {files[0].name} to {files[-1].name}"
        description = f"{meshes}, replayed on {options.onto.name}."
        write_motion(output, ending, moved, surfaces.template.faces, "Motion", description)
    if options.json:
        record = {"files": files, "onto": options.onto, "axes": options.axes}
        record |= {"transfer": options.transfer, "output": output, "n_frames": len(moved)}
        say_json(record)
        return
    say(f"meshes      {len(moved)}")
    say(f"written to  {output}")


def _disentangle(options: argparse.Namespace) -> None:
    from riemhuman.geometry import AlignedSurfaces, ElasticMetric
    from riemhuman.io.meshes import save_mesh
    from riemhuman.protocols import uninterrupted
    from riemhuman.solvers import Disentangling
    from riemhuman.surfaces.deformation_basis import DeformationBasis

    check_output_file(options.output, [".ply", ".obj", ".off"], force=options.force)
    check_picture(options)
    reporter = Reporter(options.quiet)
    surfaces = surfaces_in([options.shape, options.pose], options)
    space = AlignedSurfaces(surfaces.template, equip=False, scale=None)
    basis = DeformationBasis.load(options.basis) if options.basis else None
    solver = Disentangling(basis, pose_weight=options.pose_weight, progress=reporter.bars)
    with reporter.task("Disentangling"):
        result = solver.solve(
            ElasticMetric(space, a=1.0, lam=1.0, c=0.0),
            ElasticMetric(space, a=0.0, lam=0.0, c=1.0),
            *surfaces[:],
        )
    uninterrupted(result)
    save_mesh(options.output, result.surface, surfaces.template.faces)
    titles = [f"shape of {options.shape.stem}", f"pose of {options.pose.stem}", "both"]
    shown = [*surfaces[:], result.surface]
    write_picture(options.picture, shown, surfaces.template.faces, titles, "Shape and pose")
    if options.json:
        say_json(
            {
                "shape": options.shape,
                "pose": options.pose,
                "pose_weight": options.pose_weight,
                "shape_distance": result.shape_dist,
                "pose_distance": result.pose_dist,
                "n_iterations": result.n_iterations,
                "converged": result.converged,
                "message": result.message,
                "output": options.output,
            }
        )
        return
    say(f"distance in shape  {result.shape_dist:.8g}")
    say(f"distance in pose   {result.pose_dist:.8g}")
    say(f"converged          {convergence(result)}")
    say(f"written to         {options.output}")
