"""The commands ``transfer``, ``disentangle``, ``align``, ``fit``, ``basis``, ``convert-model``."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import riemhuman as rh
from riemhuman.cli._commands import (
    ANY_SCALE,
    FILES,
    MESH_ENDINGS,
    MODEL,
    PICTURE,
    UNIT,
    Answer,
    command,
    flag,
    mesh,
    names_matching,
    option,
    output,
    path_option,
    template,
)
from riemhuman.cli._inputs import MOTION_OUTPUT, advice, read_surfaces, write_motion
from riemhuman.cli._terminal import convergence, outcome
from riemhuman.errors import ArgumentError

_ALIGNED_PAGE = "aligned.html"
_IS_ALIGNED = names_matching(r"aligned\.html|(?is:.+\.(ply|obj|off))")


@command(
    "transfer",
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
    FILES,
    path_option("--onto", "MESH", "body to move", required=True),
    MOTION_OUTPUT,
    option(
        "--axes",
        "axes about which triangles rotate: those of the world, or those of the body, for a body "
        "in another pose than the first mesh",
        choices=("world", "body"),
        default="world",
    ),
    option(
        "--transfer",
        "replay the changes since the first mesh, or the poses themselves",
        choices=("change", "pose"),
        default="change",
    ),
    UNIT,
)
def _transfer(options: argparse.Namespace) -> Answer:
    from riemhuman.progress import ProgressBar

    surfaces = read_surfaces(options, [*options.meshes, options.onto])
    *files, onto = surfaces.files
    space = rh.AlignedSurfaces(surfaces.template, equip=False, scale=None)
    with options.task(f"Transfer of {len(files)} meshes"):
        solver = rh.solvers.MotionTransfer(options.axes, options.transfer)
        with ProgressBar(range(len(files)), disable=not options.bars, unit="mesh") as numbers:
            moved = solver.solve(space, (surfaces[k] for k in numbers), surfaces[len(files)])
    with options.task("Output"):
        meshes = f"{len(files)} meshes, {files[0].name} to {files[-1].name}"
        description = f"{meshes}, replayed on {onto.name}."
        write_motion(options, moved, surfaces.faces, "Motion", description)
    record = {"files": files, "onto": onto, "axes": options.axes}
    record |= {"transfer": options.transfer, "n_frames": len(moved)}
    return Answer({"meshes": len(moved)}, record)


@command(
    "disentangle",
    "a body with one mesh's shape and another's pose",
    "Brings the first mesh into the pose of the second by a smooth field of rotations, which\n"
    "keeps its detail. Then writes the body nearest to the first mesh in the shape metric,\n"
    "(a, λ, c) = (1, 1, 0), and to the posed mesh in the pose metric, (0, 0, 1).",
    "  riemhuman disentangle anna_standing.ply ben_sitting.ply -o anna_sitting.ply\n"
    "  riemhuman disentangle a.ply b.ply -o both.obj --pose-weight 50 --json\n"
    "  riemhuman disentangle a.ply b.ply -o both.ply --basis basis.npz\n",
    mesh("shape", "SHAPE", "mesh of the person"),
    mesh("pose", "POSE", "mesh of the pose"),
    output("MESH", *MESH_ENDINGS),
    option(
        "--pose-weight",
        "weight of the squared pose distance relative to the shape distance",
        default=1000.0,
        metavar="W",
    ),
    path_option(
        "--basis",
        "NPZ",
        "deformations by which the body may differ from SHAPE, see riemhuman basis (default: all "
        "vertices are free)",
    ),
    template("SHAPE"),
    PICTURE,
)
def _disentangle(options: argparse.Namespace) -> Answer:
    surfaces = read_surfaces(options, [options.shape, options.pose])
    space = rh.AlignedSurfaces(surfaces.template, equip=False, scale=None)
    basis = rh.DeformationBasis.load(options.basis) if options.basis else None
    solver = rh.solvers.Disentangling(basis, pose_weight=options.pose_weight, progress=options.bars)
    with options.task("Disentangling"):
        result = solver.solve(
            rh.ElasticMetric(space, a=1.0, lam=1.0, c=0.0),
            rh.ElasticMetric(space, a=0.0, lam=0.0, c=1.0),
            *surfaces[:],
        )
    rh.save_mesh(options.output, result.surface, surfaces.faces)
    if options.picture is not None:
        names = [f"shape of {options.shape.stem}", f"pose of {options.pose.stem}", "both"]
        bodies = [*surfaces[:], result.surface]
        rh.plots.save_picture(
            options.picture, bodies, surfaces.faces, names, title="Shape and pose"
        )
    record = {
        "shape": options.shape,
        "pose": options.pose,
        "pose_weight": options.pose_weight,
        "shape_distance": result.shape_dist,
        "pose_distance": result.pose_dist,
        **outcome(result),
    }
    text = {
        "distance in shape": f"{result.shape_dist:.8g}",
        "distance in pose": f"{result.pose_dist:.8g}",
        "converged": convergence(result),
    }
    return Answer(text, record, trusted=bool(result.converged))


@command(
    "align",
    "registered meshes aligned with a template",
    "Rotates and translates meshes onto the template by Procrustes alignment, without\n"
    "scaling, and writes them under their names into a folder with a page that shows them.\n"
    "--unit and --up convert meshes to metres with y up.",
    "  riemhuman align scans/ -o aligned/\n"
    "  riemhuman align scans/ -o aligned/ --template anna.ply\n"
    "  riemhuman align scans/ -o aligned/ --unit millimetres --up z\n",
    FILES,
    output("FOLDER", text="folder to write", is_ours=_IS_ALIGNED),
    template("the first mesh", "to align with"),
)
def _align(options: argparse.Namespace) -> Answer:
    import numpy as np

    from riemhuman.io.outputs import atomic_folder

    options.align = True
    surfaces = read_surfaces(options, options.meshes)
    names = [file.name for file in surfaces.files]
    if len(set(names)) < len(names):
        raise ArgumentError(
            "two meshes have the same name and would overwrite each other in the folder"
        )
    with options.task(f"Alignment of {len(names)} meshes"):
        points = surfaces[:]
    gaps = np.linalg.norm(points - surfaces.template.vertices, axis=-1)
    distances = np.sqrt((gaps**2).mean(axis=-1))
    faces, titles = surfaces.faces, [file.stem for file in surfaces.files]
    with atomic_folder(options.output, _IS_ALIGNED) as folder:
        for name, surface in zip(names, points, strict=True):
            rh.save_mesh(folder / name, surface, faces)
        rh.plots.save_picture(folder / _ALIGNED_PAGE, points, faces, titles, title="Aligned meshes")
    said = ["root mean square distances from the template, in metres:"]
    said += [f"{distance:.6f}  {name}" for name, distance in zip(names, distances, strict=True)]
    return Answer("\n".join(said), {"files": surfaces.files, "root_mean_square": distances})


@command(
    "fit",
    "shape and pose of a body model for registered meshes",
    "Fits the shape coefficients, pose and translation of a body model to meshes that share\n"
    "its triangulation, and writes the arrays betas, pose, trans, distances and names to an\n"
    ".npz file.",
    "  riemhuman fit scans/ -o fits.npz                       # the open model\n"
    "  riemhuman fit anna.ply ben.ply -o fits.npz --model SMPL.npz\n"
    "  riemhuman fit scans/ -o fits.npz --picture fits.html --json\n",
    FILES,
    output("NPZ", ".npz"),
    MODEL,
    ANY_SCALE,
    UNIT,
    PICTURE,
)
def _fit(options: argparse.Namespace) -> Answer:
    import numpy as np

    from riemhuman.progress import ProgressBar

    surfaces = read_surfaces(options, options.meshes)
    files = surfaces.files
    model = _fitted_model(options, surfaces.template.n_vertices, files[0])
    with options.task(f"Fit of {len(files)} meshes"):
        numbers = ProgressBar(range(len(files)), disable=not options.bars, unit="mesh")
        fits = [model.fit(surfaces[number]) for number in numbers]
    names = [file.name for file in files]
    fields = ("betas", "pose", "trans", "distances")
    arrays = {field: np.stack([getattr(fit, field) for fit in fits]) for field in fields}
    rh.io.save_arrays(options.output, {**arrays, "names": np.array(names)})
    if options.picture is not None:
        models = [model(fit.betas, fit.pose, fit.trans) for fit in fits]
        pairs = zip(surfaces[:], models, strict=True)
        rh.plots.save_picture(
            options.picture,
            [surface for pair in pairs for surface in pair],
            surfaces.faces,
            [title for file in files for title in (file.stem, f"{file.stem}, model")],
            title="Meshes, each beside its model",
        )
    means = [1000.0 * float(fit.mean_distance) for fit in fits]
    converged = [bool(fit.converged) for fit in fits]
    said = ["mean distances between mesh and model:"]
    said += [
        f"{mean:8.3f} mm  {name}{'' if done else '  (did not converge)'}"
        for name, mean, done in zip(names, means, converged, strict=True)
    ]
    record = {"files": files, "mean_distance_mm": means, "converged": converged}
    return Answer("\n".join(said), record, trusted=all(converged))


def _fitted_model(options: argparse.Namespace, n_vertices: int, first: Path) -> Any:
    if options.model is not None:
        return rh.BodyModel.from_file(options.model)
    for resolution in ("coarse", "full"):
        model = rh.datasets.load_open_model(resolution)
        if model.n_vertices == n_vertices:
            return model
    raise ArgumentError(
        f"the meshes have {n_vertices:,} vertices, but the open model has 1,202 or 13,348; "
        f"give the model that they are registered to with --model FILE, or {advice(first)}"
    )


@command(
    "basis",
    "a basis of deformations from motions",
    "Writes the principal components of the deformations in motions, for geodesics and\n"
    "means. Motions are files of Dynamic FAUST (.hdf5), folders of registered meshes that\n"
    "show one motion in the order of their names, or folders of such folders. They need\n"
    "not fit into memory.",
    "  riemhuman basis registrations_m.hdf5 registrations_f.hdf5 -o basis.npz\n"
    "  riemhuman basis registrations_m.hdf5 --sequences punching knees -o basis.npz\n"
    "  riemhuman basis walk/ jump/ -o basis.npz --step 5 --n-components 40\n"
    "  riemhuman basis --open --resolution coarse -o basis.npz\n",
    path_option("motions", "MOTIONS", "HDF5 files or folders", nargs="*"),
    flag("--open", "use the open motions that ship with the package"),
    option(
        "--resolution",
        "with --open: 13,348 or 1,202 vertices",
        choices=("full", "coarse"),
        default="full",
    ),
    option("--subjects", "with --open or HDF5: only these people", nargs="+", metavar="NAME"),
    option("--sequences", "with --open or HDF5: only these motions", nargs="+", metavar="NAME"),
    output("NPZ", ".npz"),
    option("-n --n-components", "components", default=100, metavar="K"),
    option(
        "--step",
        "number of frames between the two surfaces of a deformation",
        default=10,
        metavar="FRAMES",
    ),
    UNIT,
)
def _basis(options: argparse.Namespace) -> Answer:
    motions = _basis_motions(options)
    n_frames = sum(len(motion) for motion in motions)
    with options.task(f"{len(motions)} motions, {n_frames:,} frames"):
        basis = rh.DeformationBasis.from_motions(
            motions, options.n_components, options.step, progress=options.bars
        )
    basis.save(options.output)
    ratio = basis.explained_variance_ratio
    explained = None if ratio is None else float(ratio.sum())
    record = {
        "n_components": basis.n_components,
        "n_vertices": basis.n_vertices,
        "n_motions": len(motions),
        "n_frames": n_frames,
        "step": options.step,
        "explained_variance": explained,
    }
    said = [f"{basis.n_components} deformations of {basis.n_vertices:,} vertices"]
    if explained is not None:
        said.append(f"{100 * explained:.3f} % of the variance of the motions")
    return Answer("\n".join(said), record)


def _basis_motions(options: argparse.Namespace) -> list[Any]:
    """Return the chosen motions, whose frames are read when they are needed."""
    from riemhuman.io.mesh_arrays import face_difference

    if options.open == bool(options.motions):
        raise ArgumentError("give either HDF5 files or folders of motions, or --open")
    chosen = {"subjects": options.subjects, "sequences": options.sequences}
    if options.open:
        return list(rh.datasets.load_open_motions(options.resolution, **chosen))
    if (options.unit or options.up) and not any(map(Path.is_dir, options.motions)):
        raise ArgumentError("--unit and --up are for folders of meshes; HDF5 files are in metres")
    motions: list[Any] = []
    for place in options.motions:
        if place.is_dir() and not list(place.glob("*.hdf5")):
            if any(chosen.values()):
                raise ArgumentError(
                    f"--subjects and --sequences choose from HDF5 files; {place} is a folder of "
                    "meshes"
                )
            motions += rh.datasets.load_mesh_motions(place, unit=options.unit, up=options.up)
        else:
            motions += rh.datasets.load_dfaust(place, **chosen)
    for motion in motions[1:]:
        difference = face_difference(motion.faces, motions[0].faces)
        if difference:
            raise ArgumentError(
                f"all motions must share one triangulation; {motion.sequence} and "
                f"{motions[0].sequence} do not: {difference}"
            )
    return motions


@command(
    "convert-model",
    "plain arrays from a body model's pickle",
    "Writes a model of the SMPL family as an .npz file of plain arrays. A pickle is code: it\n"
    "is read as data and never run, and a call that is not known is refused by name.",
    "  riemhuman convert-model basicmodel_neutral_lbs_10_207_0_v1.0.0.pkl -o SMPL.npz\n"
    "  riemhuman convert-model smplh/female/model.npz -o SMPLH_female.npz --n-betas 16\n",
    path_option("source", "MODEL", ".pkl or .npz file"),
    output("NPZ", ".npz"),
    option(
        "--n-betas",
        "number of shape coefficients to keep (default: 10 of 300 or more, else all)",
        type=int,
        metavar="B",
    ),
)
def _convert_model(options: argparse.Namespace) -> Answer:
    with options.task("Converting"):
        model = rh.bodies.convert_model(options.source, options.output, n_betas=options.n_betas)
    contents = rh.bodies.model_contents(options.source, options.n_betas)
    text = (
        f"{contents}\n{model.n_vertices:,} vertices, {model.n_joints} joints, {model.n_betas} "
        "shape coefficients"
    )
    record = {"vertices": model.n_vertices, "joints": model.n_joints}
    return Answer(text, record | {"shape_coefficients": model.n_betas})
