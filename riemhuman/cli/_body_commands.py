"""The commands that make bodies: paths, means, transfers, fits, bases, models, registration."""

from __future__ import annotations

import argparse
import dataclasses
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import riemhuman as rh
from riemhuman.cli import _commands as cli
from riemhuman.cli import _inputs as inputs
from riemhuman.cli import _terminal as terminal
from riemhuman.errors import ArgumentError, counted

if TYPE_CHECKING:
    from riemhuman.arrays import Array
    from riemhuman.bodies import BodyModel
    from riemhuman.datasets import Motion

_COMPONENTS_METRIC = (1.0, 1.0, 0.0)  # with a much smaller λ, triangles have no logarithm
_PARTS = ((1.0, 1.0, 0.0), (0.0, 0.0, 1.0))  # metrics of shape and of pose
_DEVIATIONS = 2.0
_MOST_SAMPLES = 10_000  # random bodies, each of which is a file
_COMPONENT_FILES = (
    r"(mean|component_\d+_(minus|plus)|sample_\d{4,})\.ply|components\.html|summary\.json"
)


@cli.command(
    "geodesic",
    "Finds the geodesic (minimum-energy path) between two meshes over a basis of deformations.\n"
    "The metric does not see translations: surfaces are moved to stand on the ground.\n"
    "Writes a folder with the meshes time_0000.ply, ..., path.glb, path.npz, path.png, path.html\n"
    "and summary.json, or one file.",
    "  riemhuman geodesic sit.ply stand.ply -o path/\n"
    "  riemhuman geodesic sit.ply stand.ply -o path.glb --n-nodes 21\n"
    "  riemhuman geodesic a.ply b.ply -o path/ --basis basis.npz -a 1 -l 1 -c 0 --json\n",
    cli.mesh_option("a_file", "A", "mesh to start from"),
    cli.mesh_option("b_file", "B", "mesh to end at"),
    inputs.path_output("time", "path.glb", "path.npz", "path.png", "path.html"),
    cli.option("--n-nodes", "surfaces of the path", default=11, metavar="N"),
    inputs.BASIS,
    inputs.metric_options("A", inputs.PATH_METRIC),
)
def _geodesic(options: argparse.Namespace) -> cli.Answer:
    surfaces = inputs.read_surfaces(options, [options.a_file, options.b_file])
    metric = inputs.chosen_metric(options, surfaces.template)
    basis = inputs.chosen_basis(options, surfaces.template)
    solver = rh.solvers.BasisPath(basis, options.n_nodes, progress=options.bars)
    start = time.perf_counter()
    with options.task(f"Geodesic, {metric}"):
        result = solver.solve(metric, *surfaces[:])
    record = {
        "from": options.a_file,
        "to": options.b_file,
        "n_nodes": len(result.path),
        "metric": inputs.metric_record(metric),
        "energies": result.energies,
        "seconds": time.perf_counter() - start,
    }
    length = float(metric.length(result.path))
    distance = float(metric.dist(result.path[0], result.path[-1]))  # no path is shorter
    values = {"energy": result.energy, "length": length, "distance": distance}
    answer = terminal.solved(result, values, **record)
    description = (
        f"From {options.a_file.name} to {options.b_file.name}: the path of least energy under "
        f"{inputs.metric_in_words(metric)}. Length {length:.3g} (lower bound {distance:.3g}), "
        f"energy {result.energy:.3g}. Converged: {terminal.convergence(result)}."
    )
    inputs.write_path(
        options,
        rh.plots.on_the_ground(result.path),
        surfaces.faces,
        "Geodesic between two bodies",
        description,
        summary=answer.record,
    )
    return answer


@cli.command(
    "mean",
    "Writes the body with the least mean squared distance from the meshes. The search is over a "
    "basis of deformations and the differences between the meshes. A metric of normals alone does "
    "not measure lengths, so with --pose the metric (1, 1, 0) is added to what is minimised.",
    "  riemhuman mean anna.ply ben.ply carl.ply -o mean.ply --align\n"
    "  riemhuman mean bodies/ -o mean.obj --pose --picture mean.html\n"
    "  riemhuman mean bodies/ -o mean.ply --basis basis.npz -a 1 -l 1 -c 0.1 --json\n",
    cli.FILES,
    cli.output("MESH", *cli.MESH_ENDINGS),
    inputs.BASIS,
    inputs.metric_options("the first mesh", inputs.PATH_METRIC),
    cli.PICTURE,
)
def _mean(options: argparse.Namespace) -> cli.Answer:
    surfaces = inputs.read_surfaces(options, options.meshes)
    points = surfaces[:]
    metric = inputs.chosen_metric(options, surfaces.template)
    basis = inputs.chosen_basis(options, surfaces.template)
    with options.task(f"Mean of {len(points)}, {metric}"):
        result = rh.solvers.BasisMean(basis, progress=options.bars).solve(metric, points)
    rh.save_mesh(options.output, result.point, surfaces.faces)
    if options.picture is not None:
        names = [*(file.stem for file in surfaces.files), "Karcher mean"]
        from riemhuman.plots.figures import MEAN, SKIN

        colors = [*([SKIN] * len(points)), MEAN]
        bodies, title = [*points, result.point], "Meshes and their mean"
        viewer = rh.plots.view_bodies(bodies, surfaces.faces, names, colors=colors, title=title)
        viewer.save(options.picture)
    record = {"files": surfaces.files, "metric": inputs.metric_record(metric)}
    values = {"variance": result.variance, "picture": options.picture}
    return terminal.solved(result, values, variances=result.variances, **record)


@cli.command(
    "components",
    "Finds the directions in which meshes differ most, by principal component analysis of their "
    "logarithms at the Karcher mean. Writes a folder with the mean (mean.ply), the bodies two "
    "standard deviations from it along each component (component_1_minus.ply, "
    "component_1_plus.ply, ...), random bodies (sample_0000.ply, ...), a page with a slider for "
    "each component (components.html), and summary.json. If the bodies are in different poses, "
    "use --standard-pose, which fits a body model to them: otherwise components tear the "
    "shoulders.",
    "  riemhuman components bodies/ -o components/\n"
    "  riemhuman components bodies/ -o builds/ --standard-pose\n"
    "  riemhuman components bodies/ -o components/ -n 5 --samples 20 --seed 7\n"
    "  riemhuman components standing/*.ply -o how_they_stand/ --pose --align --json\n",
    cli.FILES,
    cli.output("FOLDER", names=_COMPONENT_FILES, always="components.html"),
    cli.option("-n --n-components", "components", default=3, metavar="K"),
    cli.option("--samples", "number of random bodies", default=0, metavar="N"),
    cli.option("--seed", "seed of the random bodies", default=0, metavar="S"),
    cli.flag("--standard-pose", "bring bodies to the standard pose of their model first"),
    inputs.MEASURED_MODEL,
    cli.needs("--model", "--standard-pose"),
    inputs.metric_options("the first mesh", _COMPONENTS_METRIC),
)
def _components(options: argparse.Namespace) -> cli.Answer:
    import numpy as np

    if options.metric == "shape":
        raise ArgumentError(
            "the λ of --shape is too small for logarithms between people; leave --shape out: "
            "the default weights also describe shape"
        )
    count = options.n_components
    surfaces = inputs.read_surfaces(options, options.meshes)
    if not 0 < count < len(surfaces):
        raise ArgumentError(f"-n {count} must be below the number of meshes, {len(surfaces)}")
    if not 0 <= options.samples <= _MOST_SAMPLES:
        raise ArgumentError(
            f"--samples must be from 0 to {_MOST_SAMPLES:,}; found {options.samples}"
        )
    points = surfaces[:]
    metric = inputs.chosen_metric(options, surfaces.template)
    if options.standard_pose:
        definitions = inputs.measurements_of(
            options, surfaces.template, surfaces.files[0]
        ).definitions
        with options.task(f"Standard pose of {counted(len(points), 'mesh', 'meshes')}"):
            points = rh.measurements.in_standard_pose(definitions, points)
    with options.task(f"Components of {len(points)}, {metric}"):
        nearest = rh.solvers.NearestSurface(progress=options.bars)
        pca = rh.TangentPCA(metric, count, nearest=nearest).fit(points)
    numbers = range(1, pca.n_components_ + 1)
    names = ["mean", *(f"component_{k}_{side}" for k in numbers for side in ("minus", "plus"))]
    names += [f"sample_{k:04d}" for k in range(options.samples)]
    with options.task(counted(len(names), "body", "bodies")):
        ends = np.diag(_DEVIATIONS * np.sqrt(pca.explained_variance_))
        coordinates = [sign * end for end in ends for sign in (-1.0, 1.0)]
        bodies = [pca.mean_, *pca.inverse_transform(np.array(coordinates))]
        if options.samples:
            samples = pca.sample(options.samples, options.seed)
            bodies += list(samples.reshape(-1, *pca.mean_.shape))
    record = {
        "files": surfaces.files,
        "metric": inputs.metric_record(metric),
        "standard_pose": options.standard_pose,
        "n_components": pca.n_components_,
        "explained_variance": pca.explained_variance_,
        "explained_variance_ratio": pca.explained_variance_ratio_,
        "deviations": _DEVIATIONS,
        "coordinates": pca.transform(points),
        "samples": options.samples,
        "seed": options.seed,
    }
    meshes = dict(zip((f"{name}.ply" for name in names), bodies, strict=True))
    with inputs.mesh_folder(options, meshes, surfaces.faces, record) as folder:
        titles = [name.replace("_", " ") for name in names]
        viewer = rh.plots.view_components(pca, surfaces.faces, title="Components of bodies")
        folder_view = rh.plots.view_bodies(np.array(bodies), surfaces.faces, titles)
        choices = {**viewer.choices, "Bodies in this folder": folder_view.choices["Bodies"]}
        dataclasses.replace(viewer, choices=choices).save(folder / "components.html")
    shares = zip(numbers, pca.explained_variance_ratio_, strict=True)
    lines = [f"component {k}  {100 * share:.1f} % of the variance" for k, share in shares]
    return cli.Answer("\n".join(lines), record)


@cli.command(
    "transfer",
    "Replays a motion (a sequence of registered meshes) on another body with the same\n"
    "triangulation. By default, the body must be in the pose of the first mesh; with "
    "--transfer\n"
    "pose, it may be in any pose. Writes a folder with the meshes frame_0000.ply, ... and\n"
    "motion.html, a page that plays them, or one file.",
    "  riemhuman transfer motion/ --onto ben.ply -o motion_of_ben/\n"
    "  riemhuman transfer motion/ --onto ben.ply -o motion_of_ben.glb\n"
    "  riemhuman transfer run_*.obj --onto ben.ply -o run_of_ben.npz\n"
    "  riemhuman transfer hands_on_head/ --onto ben.ply --transfer pose -o ben_too/\n",
    cli.FILES,
    cli.mesh_option("--onto", "MESH", "body to move", required=True),
    inputs.MOTION_OUTPUT,
    cli.choice("--transfer", "replay changes since the first mesh, or poses", "change", "pose"),
    cli.UNIT,
)
def _transfer(options: argparse.Namespace) -> cli.Answer:
    from tqdm import tqdm

    surfaces = inputs.read_surfaces(options, [*options.meshes, options.onto])
    files, onto = surfaces.files[:-1], surfaces.files[-1]
    space = rh.AlignedSurfaces(surfaces.template, equip=False, scale=None)
    with options.task(f"Transfer of {counted(len(files), 'mesh', 'meshes')}"):
        solver = rh.solvers.MotionTransfer(options.transfer)
        recorded = surfaces[: len(files)]
        with tqdm(recorded, disable=not options.bars, unit="mesh") as meshes:
            moved = solver.solve(space, meshes, surfaces[len(files)])
    moved = rh.plots.on_the_ground(moved, like=recorded)
    replayed = counted(len(files), "mesh", "meshes")
    description = f"{replayed}, {files[0].name} to {files[-1].name}, replayed on {onto.name}."
    inputs.write_path(options, moved, surfaces.faces, "Motion", description)
    record = {
        "files": files,
        "onto": onto,
        "transfer": options.transfer,
        "n_frames": len(moved),
    }
    return cli.Answer({"meshes": len(moved)}, record)


@cli.command(
    "disentangle",
    "Brings the first mesh into the pose of the second with a smooth field of rotations, which "
    "keeps its detail. Then finds and writes the body nearest to the first mesh under the shape "
    "metric, (a, λ, c) = (1, 1, 0), and to the posed mesh under the pose metric, (0, 0, 1).",
    "  riemhuman disentangle anna_standing.ply ben_sitting.ply -o anna_sitting.ply\n"
    "  riemhuman disentangle a.ply b.ply -o both.obj --pose-weight 50 --json\n"
    "  riemhuman disentangle a.ply b.ply -o both.ply --basis basis.npz\n",
    cli.mesh_option("shape", "SHAPE", "mesh of the person"),
    cli.mesh_option("pose", "POSE", "mesh of the pose"),
    cli.output("MESH", *cli.MESH_ENDINGS),
    cli.option("--pose-weight", "weight of the squared pose distance", default=1000.0, metavar="W"),
    cli.path_option(
        "--basis", "NPZ", "basis of deformations of the body (default: all deformations)"
    ),
    cli.template("SHAPE"),
    cli.PICTURE,
)
def _disentangle(options: argparse.Namespace) -> cli.Answer:
    surfaces = inputs.read_surfaces(options, [options.shape, options.pose])
    space = rh.AlignedSurfaces(surfaces.template, equip=False, scale=None)
    basis = rh.DeformationBasis.load(options.basis) if options.basis else None
    solver = rh.solvers.Disentangling(basis, pose_weight=options.pose_weight, progress=options.bars)
    of_shape, of_pose = (rh.ElasticMetric(space, a=a, lam=lam, c=c) for a, lam, c in _PARTS)
    shape, pose = surfaces[:]
    with options.task("Disentangling"):
        result = solver.solve(of_shape, of_pose, shape, pose)
    rh.save_mesh(options.output, result.surface, surfaces.faces)
    if options.picture is not None:
        names = [f"shape of {options.shape.stem}", f"pose of {options.pose.stem}", "both"]
        bodies = [*surfaces[:], result.surface]
        viewer = rh.plots.view_bodies(bodies, surfaces.faces, names, title="Shape and pose")
        viewer.save(options.picture)
    values = {"shape_distance": result.shape_dist, "pose_distance": result.pose_dist}
    record = {"shape": options.shape, "pose": options.pose, "pose_weight": options.pose_weight}
    return terminal.solved(result, values, **record)


@cli.command(
    "align",
    "Rotates and translates meshes onto the template by Procrustes alignment, without scaling,\n"
    "and writes them, under the same names, into a folder with a page that shows them. --unit\n"
    "and --up convert meshes to metres with y up.",
    "  riemhuman align bodies/ -o aligned/\n"
    "  riemhuman align bodies/ -o aligned/ --template anna.ply\n"
    "  riemhuman align bodies/ -o aligned/ --unit millimetres --up z\n",
    cli.FILES,
    cli.output("FOLDER", names=r"aligned\.html|(?is:.+\.(ply|obj|off))", always="aligned.html"),
    cli.template("the first mesh", "to align with"),
    cli.OUTPUT_UNITS,
)
def _align(options: argparse.Namespace) -> cli.Answer:
    import numpy as np

    options.align = True
    surfaces = inputs.read_surfaces(options, options.meshes)
    names = [file.name for file in surfaces.files]
    if len(set(names)) < len(names):
        raise ArgumentError(
            "two meshes have the same name and would overwrite each other in the folder"
        )
    with options.task(f"Alignment of {counted(len(names), 'mesh', 'meshes')}"):
        points = surfaces[:]
    gaps = np.linalg.norm(points - surfaces.template.vertices, axis=-1)
    distances = np.sqrt((gaps**2).mean(axis=-1))
    faces, titles = surfaces.faces, [file.stem for file in surfaces.files]
    with inputs.mesh_folder(options, dict(zip(names, points, strict=True)), faces) as folder:
        page = folder / "aligned.html"
        rh.plots.view_bodies(points, faces, titles, title="Aligned meshes").save(page)
    lines = ["root mean square distances to the template:"]
    lines += _gap_lines(names, distances.tolist(), options)
    return cli.Answer("\n".join(lines), {"files": surfaces.files, "root_mean_square": distances})


@cli.command(
    "fit",
    "Fits the shape coefficients, pose and translation of a body model to meshes that share\n"
    "its triangulation, and writes the arrays betas, pose, trans, distances and names to an\n"
    ".npz file.",
    "  riemhuman fit bodies/ -o fits.npz                      # the open model\n"
    "  riemhuman fit anna.ply ben.ply -o fits.npz --model SMPL.npz\n"
    "  riemhuman fit bodies/ -o fits.npz --picture fits.html --json\n",
    cli.FILES,
    cli.output("NPZ", ".npz"),
    cli.MODEL,
    cli.ANY_SCALE,
    cli.UNIT,
    cli.OUTPUT_UNITS,
    cli.PICTURE,
)
def _fit(options: argparse.Namespace) -> cli.Answer:
    import numpy as np
    from tqdm import tqdm

    from riemhuman.surfaces.template import check_body_sizes

    surfaces = inputs.read_surfaces(options, options.meshes)
    files = surfaces.files
    model = _fitted_model(options, surfaces.template.n_vertices, files[0])
    with options.task(f"Fit of {counted(len(files), 'mesh', 'meshes')}"):
        numbers = tqdm(range(len(files)), disable=not options.bars, unit="mesh")
        fits = []
        for number in numbers:
            surface, file = surfaces[number], files[number]
            check_body_sizes(surface, model.template, str(file))
            fits.append(model.fit(surface))
    names = [file.name for file in files]
    fields = ("betas", "pose", "trans", "distances")
    arrays = {field: np.stack([getattr(fit, field) for fit in fits]) for field in fields}
    rh.io.save_arrays(options.output, {**arrays, "names": np.array(names)})
    if options.picture is not None:
        models = [model(fit.betas, fit.pose, fit.trans) for fit in fits]
        bodies = np.stack([surfaces[:], models], axis=1).reshape(-1, *models[0].shape)
        titles = [title for file in files for title in (file.stem, f"{file.stem}, model")]
        title = "Meshes, each beside its model"
        rh.plots.view_bodies(bodies, surfaces.faces, titles, title=title).save(options.picture)
    means = [float(fit.mean_distance) for fit in fits]
    converged = [bool(fit.converged) for fit in fits]
    lines = ["mean distances between mesh and model:"]
    for line, has_converged in zip(_gap_lines(names, means, options), converged, strict=True):
        lines.append(line if has_converged else f"{line}  (did not converge)")
    millimetres = [1000.0 * mean for mean in means]
    record = {"files": files, "mean_distance_mm": millimetres, "converged": converged}
    return cli.Answer("\n".join(lines), record, trusted=all(converged))


def _gap_lines(
    names: Sequence[str], gaps: Sequence[float], options: argparse.Namespace
) -> list[str]:
    """Return a line for each file: a distance between surfaces, and the file's name."""
    texts = [rh.measurements.readable_gap(gap, options.output_units) for gap in gaps]
    return [f"{text:>10}  {name}" for text, name in zip(texts, names, strict=True)]


def _fitted_model(options: argparse.Namespace, n_vertices: int, first: Path) -> BodyModel:
    if options.model is not None:
        return rh.BodyModel.from_file(options.model)
    for resolution in ("coarse", "full"):
        model = rh.datasets.load_open_model(resolution)
        if model.n_vertices == n_vertices:
            return model
    raise ArgumentError(
        f"the meshes have {n_vertices:,} vertices, but the open model has 1,202 or 13,348; "
        f"name their model with --model FILE, or {inputs.advice(first)}"
    )


@cli.command(
    "basis",
    "Writes the principal components of the deformations in motions, for geodesics and means.\n"
    "Motions are files of Dynamic FAUST (.hdf5), folders of registered meshes whose order of\n"
    "names is the order in time, folders of such folders, recordings of a skeleton (.bvh), or\n"
    "files with an array path (.npz). They need not fit into memory.",
    "  riemhuman basis registrations_m.hdf5 registrations_f.hdf5 -o basis.npz\n"
    "  riemhuman basis registrations_m.hdf5 --sequences punching knees -o basis.npz\n"
    "  riemhuman basis walk/ jump/ -o basis.npz --step 5 --n-components 40\n"
    "  riemhuman basis --open --resolution coarse -o basis.npz\n",
    cli.path_option("motions", "MOTIONS", ".hdf5, .bvh or .npz files, or folders", nargs="*"),
    cli.flag("--open", "use the bundled open motions"),
    cli.choice("--resolution", "with --open: 13,348 or 1,202 vertices", "full", "coarse"),
    cli.option("--subjects", "with --open or HDF5: only these people", nargs="+", metavar="NAME"),
    cli.option("--sequences", "with --open or HDF5: only these motions", nargs="+", metavar="NAME"),
    cli.output("NPZ", ".npz"),
    cli.option("-n --n-components", "components", default=100, metavar="K"),
    cli.option(
        "--step", "frames between the two surfaces of a deformation", default=10, metavar="N"
    ),
    cli.UNIT,
    cli.JOINTS,
    cli.FPS,
)
def _basis(options: argparse.Namespace) -> cli.Answer:
    motions = _basis_motions(options)
    n_frames = sum(len(motion) for motion in motions)
    with options.task(
        f"{counted(len(motions), 'motion', 'motions')}, {counted(n_frames, 'frame', 'frames')}"
    ):
        basis = rh.DeformationBasis.from_motions(
            motions, options.n_components, options.step, progress=options.bars
        )
    basis.save(options.output)
    ratios = basis.explained_variance_ratio
    record = {
        "n_components": basis.n_components,
        "n_vertices": basis.n_vertices,
        "n_motions": len(motions),
        "n_frames": n_frames,
        "step": options.step,
        "explained_variance": None if ratios is None else ratios.sum(),
    }
    return cli.Answer(record, record)


def _basis_motions(options: argparse.Namespace) -> Sequence[Motion | Array]:
    """Return the chosen motions, whose frames are read when they are needed."""
    if options.open == bool(options.motions):
        raise ArgumentError("give either files or folders of motions, or --open")
    choice = {"subjects": options.subjects, "sequences": options.sequences}
    if options.open:
        return rh.datasets.load_open_motions(options.resolution, **choice)
    return inputs.read_motions(options, *options.motions, **choice).motions


@cli.command(
    "convert-model",
    "Writes a model of the SMPL family as an .npz file of plain arrays. A pickle can contain\n"
    "code: it is read as data and never run, and the error for an unknown call names it.",
    "  riemhuman convert-model basicmodel_neutral_lbs_10_207_0_v1.0.0.pkl -o SMPL.npz\n"
    "  riemhuman convert-model smplh/female/model.npz -o SMPLH_female.npz --n-betas 16\n",
    cli.path_option("source", "MODEL", ".pkl or .npz file"),
    cli.output("NPZ", ".npz"),
    cli.option(
        "--n-betas", "shape coefficients (default: 10 of 300, else all)", type=int, metavar="B"
    ),
)
def _convert_model(options: argparse.Namespace) -> cli.Answer:
    with options.task("Converting"):
        model = rh.bodies.convert_model(options.source, options.output, n_betas=options.n_betas)
    contents = rh.bodies.model_contents(options.source, options.n_betas)
    record = {"vertices": model.n_vertices, "joints": model.n_joints}
    record |= {"shape_coefficients": model.n_betas}
    return cli.Answer({"used": str(contents), **record}, record)
