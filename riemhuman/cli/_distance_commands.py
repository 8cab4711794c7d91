"""The commands on distances: ``tables``, ``dist``, ``matrix``, ``retrieve`` and what shows them."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import riemhuman as rh
from riemhuman.cli import _commands as cli
from riemhuman.cli import _inputs as inputs
from riemhuman.cli import _terminal as terminal
from riemhuman.errors import ArgumentError, FileError, FileFormatError, counted
from riemhuman.optional import import_matplotlib

if TYPE_CHECKING:
    from riemhuman.arrays import Array
    from riemhuman.datasets import Bodies, RegisteredMeshes
    from riemhuman.geometry import RiemannianMetric
    from riemhuman.retrieval import RetrievalScores

_QUESTIONS = {"subject": "Who is it?", "pose": "How do they stand?"}
_N_COMPONENTS = 100  # of the basis of Dynamic FAUST
_N_NODES = 11  # surfaces of a path


def _check_people(options: argparse.Namespace) -> None:
    if options.people is not None and (options.bodies or options.faust or options.reader):
        raise ArgumentError("--people SEED is for the open bodies")


_BODY_SET = cli.several(
    cli.several(
        cli.option(
            "--open",
            "open bodies of the body model alone (plain, the default), or with individual poses, "
            "self-contact and soft tissue (natural)",
            choices=("plain", "natural"),
        ),
        cli.path_option("--faust", "FOLDER", "registrations of MPI FAUST (tr_reg_000.ply ...)"),
        cli.path_option("--bodies", "FOLDER", "registered meshes of a folder; see --labels"),
        cli.option(
            "--reader", "bodies read by another package's reader", nargs=2, metavar=("NAME", "PATH")
        ),
        exclusive=True,
    ),
    cli.option("--people", "ten other open people, drawn with this seed", metavar="SEED", type=int),
    cli.path_option(
        "--labels",
        "CSV",
        "with --bodies: table of file, subject and pose (default: labels.csv in the folder)",
    ),
    cli.path_option(
        "--template", "MESH", "with --faust or --bodies: template (default: first mesh)"
    ),
    cli.flag(
        "--allow-missing", "with --faust or --bodies: leave out bodies without a file or a label"
    ),
    cli.UNIT,
    cli.needs("--labels --unit --up", "--bodies FOLDER"),
    cli.needs("--template --allow-missing", "--faust FOLDER", "--bodies FOLDER"),
    cli.checked(_check_people),
)


def _read_body_set(options: argparse.Namespace, resolution: str) -> Bodies:
    """Return the bodies that the options choose, the open bodies at a resolution."""
    template, allow_missing = options.template, options.allow_missing
    bodies: Bodies
    if options.faust is not None:
        return rh.datasets.load_faust(options.faust, template, allow_missing=allow_missing)
    if options.bodies is not None:
        settings = {"unit": options.unit, "up": options.up, "progress": options.bars}
        settings["allow_missing"] = allow_missing
        return rh.datasets.load_bodies(options.bodies, options.labels, template, **settings)
    if options.reader is not None:
        name, place = options.reader
        bodies = rh.extensions.extension("readers", name)(place)
        report = rh.testing.check_dataset(bodies)
        if not report.passed:
            raise ArgumentError(f"--reader {name} returns unusable bodies. {report}")
        return bodies
    return rh.datasets.load_open_bodies(resolution, options.open or "plain", options.people)


@cli.command(
    "tables",
    "Computes all distances between registered human bodies, and prints how well they find the\n"
    "same person (shape) and the same pose. The default data are the 100 bundled open bodies,\n"
    "ten people in ten poses.",
    "  riemhuman tables\n"
    "  riemhuman tables --resolution coarse\n"
    "  riemhuman tables --open natural --people 1    # ten people not used in tuning\n"
    "  riemhuman tables --faust ~/MPI-FAUST\n"
    "  riemhuman tables --bodies bodies/ --labels bodies/labels.csv\n"
    "  riemhuman tables --all --resolution coarse    # also descriptors and model vectors\n",
    _BODY_SET,
    cli.choice("--resolution", "open bodies of 13,348 or 1,202 vertices", "full", "coarse"),
    cli.flag(
        "--all", "compare all representations, with mean average precision and times; takes minutes"
    ),
)
def _tables(options: argparse.Namespace) -> cli.Answer:
    with options.task("Loading the bodies"):
        bodies = _read_body_set(options, options.resolution)
    n_people, n_poses = (
        "unknown" if labels is None else len(set(labels))
        for labels in (bodies.subject, bodies.pose)
    )
    head = (
        f"{len(bodies)} bodies: {n_people} people, {n_poses} poses, "
        f"{bodies.template.n_vertices:,} vertices, {bodies.template.n_faces:,} triangles"
    )
    natural = options.open == "natural" and not options.all
    compared = rh.retrieval.representations(bodies) if options.all else None
    records = rh.retrieval.benchmark(
        bodies, compared, learned=natural, progress=options.bars, task=options.task
    )
    if options.all:
        return cli.Answer(f"{head}\n\n{rh.retrieval.format_benchmark(records)}", records)
    titles = rh.retrieval.benchmarks.TITLES
    scores_by_title: dict[str, dict[str, RetrievalScores]] = {}
    for record in records:
        if record.scores is None:
            raise ArgumentError(f"{record.representation} cannot be computed: {record.problem}")
        scores_by_title.setdefault(titles[record.task], {})[record.representation] = record.scores
    end = (
        "Per cent, each body against all others: NN nearest neighbour, FT and ST first and second "
        "tier."
    )
    if natural:
        end += " Among other people: other bodies of the same person are left out."
    parts = [rh.retrieval.format_table(title, rows) for title, rows in scores_by_title.items()]
    return cli.Answer("\n\n".join([head, *parts, end]), scores_by_title)


@cli.command(
    "dist",
    "Prints the distance between two meshes that share one triangulation (PLY, OBJ, OFF), and,\n"
    "on standard error, its unit and typical distances under the metric.",
    "  riemhuman dist anna_1.ply ben_1.ply             # who it is\n"
    "  riemhuman dist anna_1.ply anna_2.ply --pose     # how they stand\n"
    "  riemhuman dist a.obj b.obj -a 1 -l 0.01 -c 0.5 --align --json\n",
    cli.mesh_option("a_file", "A"),
    cli.mesh_option("b_file", "B"),
    inputs.metric_options("A"),
)
def _dist(options: argparse.Namespace) -> cli.Answer:
    surfaces = inputs.read_surfaces(options, [options.a_file, options.b_file])
    metric = inputs.metric_of_people(options, surfaces)
    first, second = surfaces[:]
    distance = float(metric.dist(first, second))
    if not (options.quiet or options.align or metric.is_rotation_invariant):
        aligned = metric.dist(first, rh.procrustes(second, to=first, scale=None))
        if aligned**2 < distance**2 / 2:
            terminal.note(
                "warning: B is rotated relative to A, and this metric depends on rotations; "
                f"without the rotation, the distance is {aligned:.4g} (see --align)"
            )
    record = {"distance": distance, "metric": inputs.metric_record(metric)}
    record |= {"files": surfaces.files, "template": options.template or options.a_file}
    record |= {"aligned": options.align}
    record["unit"] = None if options.extension or options.any_scale else "m"
    if not (options.quiet or options.json):
        _note_scale(options, surfaces.are_scans)
    return cli.Answer(f"{distance:.10g}", record)


def _note_scale(options: argparse.Namespace, are_scans: bool) -> None:
    """Say the unit of a distance, and how far the open bodies are from each other."""
    if options.extension:
        terminal.note("the unit is that of the added metric")
        return
    if options.any_scale:
        terminal.note("the unit is that of the files")
        return
    usual = rh.measurements.usual_distances(
        lambda template: inputs.chosen_metric(options, template, are_scans=are_scans)
    )
    terminal.note(
        "in metres (square root of an area, not a gap between surfaces); for comparison: "
        f"same person, another pose ≈ {usual.one_person:.3f}; another person, same pose ≈ "
        f"{usual.two_people:.3f} (open bodies)"
    )


@cli.command(
    "matrix",
    "Writes all distances between the meshes of a folder, with their names: an .npz file with\n"
    "the arrays distances (n, n), names (n,) and metric, a table (.csv), or both. With\n"
    "--paths, it also finds the geodesic over a basis for every pair; the file\n"
    "then also has the array lengths (n, n), and the table shows lengths. The geodesic\n"
    "distance lies between the distance and the length.",
    "  riemhuman matrix bodies/ -o D.npz\n"
    "  riemhuman matrix bodies/ -o D.npz --csv D.csv --pose --align\n"
    "  riemhuman matrix thousands/ -o D.npz --resume work/     # run it again to go on\n"
    "  riemhuman matrix bodies/ -o D.npz --paths --basis basis.npz -a 1 -l 1 -c 0.1\n"
    "  riemhuman matrix bodies/ --csv - --quiet | column -s, -t\n",
    cli.FOLDER,
    cli.output("NPZ", ".npz", required=False),
    cli.output(
        "CSV",
        *(".csv", ".tsv", ".txt"),
        text="table to write; - is standard output",
        flags="--csv",
        required=False,
        takes_stream=True,
    ),
    cli.option("--jobs", "threads (default: one per core)", metavar="N", type=int, default=-1),
    cli.choice(
        "--precision", "single is faster, with relative errors below 1e-5", "double", "single"
    ),
    cli.path_option(
        "--resume", "FOLDER", "folder for finished work, so that the command can be resumed"
    ),
    cli.flag("--paths", "also find paths and their lengths"),
    cli.option("--n-nodes", f"surfaces of a path (default: {_N_NODES})", type=int, metavar="N"),
    inputs.BASIS,
    cli.needs("--n-nodes --basis --n-components", "--paths"),
    inputs.metric_options("the first mesh"),
)
def _matrix(options: argparse.Namespace) -> cli.Answer:
    import numpy as np

    from riemhuman.io.files import write_text

    if options.output is None and options.csv is None:
        raise ArgumentError("nothing to write; give -o NPZ, --csv CSV, or both")
    if options.json and options.csv == "-":
        raise ArgumentError("--json and --csv - both write to standard output; leave one out")
    if options.paths and options.precision != "double":
        raise ArgumentError("--precision single cannot be combined with --paths; leave out one")
    surfaces = inputs.read_surfaces(options, rh.datasets.find_meshes(options.folder))
    metric = inputs.metric_of_people(options, surfaces)
    n_pairs = len(surfaces) * (len(surfaces) - 1) // 2
    count = f"{counted(n_pairs, 'distance', 'distances')}, {metric}"
    try:
        with options.task(count):
            compute = _path_distances if options.paths else _distances
            matrices, remarks = compute(metric, surfaces, options)
    except KeyboardInterrupt:
        if options.resume is not None:
            terminal.note(
                f"finished work is kept in {options.resume}; the same command continues it"
            )
        raise

    names = [file.name for file in surfaces.files]
    text = terminal.matrix_text(names, matrices["lengths" if options.paths else "distances"])
    if options.output is not None:
        arrays = {**matrices, "names": np.array(names), "metric": np.array(str(metric))}
        rh.io.save_arrays(options.output, arrays)
    record = {"names": names, **matrices, "metric": inputs.metric_record(metric)}
    if options.csv == "-":
        return cli.Answer(text.rstrip("\n"), record, written=False)
    if options.csv is not None:
        write_text(options.csv, text)
    summary = f"{counted(len(names), 'mesh', 'meshes')}, {count}"
    return cli.Answer("\n".join([summary, *remarks]), record)


def _distances(
    metric: RiemannianMetric, surfaces: inputs.Surfaces, options: argparse.Namespace
) -> tuple[dict[str, Array], list[str]]:
    """Return the matrix of distances by its name, and no remarks."""
    settings = {"n_jobs": options.jobs, "precision": options.precision, "progress": options.bars}
    if options.resume is None:
        distances = metric.dist_pairwise(surfaces, **settings)
    else:
        distances = rh.pairwise_job(metric, surfaces, options.resume, **settings)
    return {"distances": distances}, []


def _path_distances(
    metric: RiemannianMetric, surfaces: inputs.Surfaces, options: argparse.Namespace
) -> tuple[dict[str, Array], list[str]]:
    """Return the matrices of distances and of path lengths by their names, and remarks on them."""
    import numpy as np

    basis = inputs.chosen_basis(options, surfaces.template)
    solver = rh.solvers.BasisPath(basis, options.n_nodes or _N_NODES)
    points = surfaces[:]
    settings = {"n_jobs": options.jobs, "progress": options.bars}
    if options.resume is None:
        paths = rh.solvers.path_distances(solver, metric, points, **settings)
    else:
        paths = rh.path_job(solver, metric, points, options.resume, **settings)
    remarks = [paths.message]
    excess = paths.excess[np.isfinite(paths.excess)]  # undefined where the distance is zero
    if len(excess):
        remarks.append(
            f"paths are longer than distances by {np.median(excess):.2f} % in the median, "
            f"{excess.max():.2f} % at most"
        )
    return {"distances": paths.bounds, "lengths": paths.lengths}, remarks


@cli.command(
    "retrieve",
    "Prints the meshes of a folder that are nearest to a query, the nearest first, with rank,\n"
    "distance and file. If the query is in the folder, it is skipped.",
    "  riemhuman retrieve anna_1.ply bodies/           # the same person\n"
    "  riemhuman retrieve anna_1.ply bodies/ --pose -k 10\n"
    "  riemhuman retrieve anna_1.ply bodies/ -k 1 --json\n",
    cli.mesh_option("query", "QUERY"),
    cli.FOLDER,
    cli.option("-k", "number of meshes to print", default=5, metavar="K"),
    inputs.metric_options("QUERY"),
)
def _retrieve(options: argparse.Namespace) -> cli.Answer:
    import numpy as np

    if options.k < 1:
        raise ArgumentError(f"-k must be at least 1; found {options.k}")
    query = options.query
    options.template = options.template or query
    query_surfaces = inputs.read_surfaces(options, [query])
    files = [f for f in rh.datasets.find_meshes(options.folder) if not f.samefile(query)]
    if not files:
        raise ArgumentError(f"{options.folder} holds no mesh other than the query")
    candidates = inputs.read_surfaces(options, files)
    query_surfaces.are_scans |= candidates.are_scans
    metric = inputs.metric_of_people(options, query_surfaces)
    with options.task(f"{len(files):,} distances, {metric}"):
        (distances,) = metric.cdist(
            query_surfaces[:], candidates, n_jobs=-1, precision="double", progress=options.bars
        )
    nearest = np.argsort(distances, kind="stable")[: options.k]
    results = [{"file": files[i], "distance": distances[i]} for i in nearest]
    lines = [
        f"{rank:>3}  {distances[i]:.6f}  {files[i]}" for rank, i in enumerate(nearest, start=1)
    ]
    record = {"query": query, "metric": inputs.metric_record(metric), "results": results}
    return cli.Answer("\n".join(lines), record)


def _matrix_options(*, required: bool) -> cli.Argument:
    return cli.several(
        cli.path_option("matrix", "MATRIX", "distances (.npz, or .csv), see riemhuman matrix"),
        cli.path_option("--labels", "CSV", "table of file, subject and pose", required=required),
        cli.flag("--allow-missing", "leave out meshes without labels, and labels without a mesh"),
    )


def _read_matrix(options: argparse.Namespace) -> tuple[Array, list[str], dict[str, list[str]]]:
    """Return distances, names and labels of meshes: if a table is given, of those in it."""
    from riemhuman.io.text_tables import TABLE_ENDINGS, read_matrix

    file = options.matrix
    if file.suffix.lower() in TABLE_ENDINGS:
        names, distances = read_matrix(file)
    else:
        arrays: dict[str, Array] = rh.io.load_arrays(file, ["distances", "names"])
        distances, names = arrays["distances"], [str(name) for name in arrays["names"]]
    if distances.shape != (len(names), len(names)):
        raise FileFormatError(
            f"{file}: distances must be a matrix with a row and a column for each of its "
            f"{len(names)} names; found shape {distances.shape}"
        )
    if options.labels is None:
        return distances, names, {}
    allow_missing = options.allow_missing
    chosen, labels = rh.datasets.read_labels(options.labels, names, allow_missing=allow_missing)
    return distances[chosen][:, chosen], [names[number] for number in chosen], labels


@cli.command(
    "scores",
    "Prints how many of the nearest meshes show the same person, and how many show the same\n"
    "pose: nearest neighbour (NN), first and second tier (FT, ST) and mean average precision\n"
    "(mAP), in per cent.",
    "  riemhuman scores D.npz --labels labels.csv\n"
    "  riemhuman scores D.npz --labels labels.csv --json\n",
    _matrix_options(required=True),
)
def _scores(options: argparse.Namespace) -> cli.Answer:
    distances, _, labels_by_question = _read_matrix(options)
    scores = {
        name: rh.retrieval.scores(distances, labels)
        for name, labels in labels_by_question.items()
        if len(set(labels)) < len(labels)
    }
    if not scores:
        raise ArgumentError(f"{options.labels}: no two meshes share a subject or a pose")
    return cli.Answer({_QUESTIONS[name]: str(score) for name, score in scores.items()}, scores)


@cli.command(
    "plot",
    "Draws the meshes of a distance matrix (see riemhuman matrix) as points in the plane, by "
    "multidimensional scaling, the best approximation of the distances in a plane, or by t-SNE, "
    "which preserves neighbourhoods. Bodies differ in more than two ways, so the picture says how "
    "far its distances are off, and how many nearest neighbours it keeps. Refuses to draw if "
    "neither distances nor neighbours survive. Points show the names of their files, or have the "
    "colours of their labels. With --bodies, one body of each label is drawn next to its points, "
    "and on a page (.html), pointing at a point shows its body.",
    "  riemhuman plot D.csv\n"
    "  riemhuman plot D.npz --labels labels.csv --bodies bodies/ -o map.html\n"
    "  riemhuman plot D.npz --labels labels.csv -o people.svg\n"
    "  riemhuman plot D.npz --labels labels.csv --by pose --method t-sne -o poses.pdf\n",
    _matrix_options(required=False),
    cli.output(
        "FILE",
        *cli.FIGURE_ENDINGS,
        ".html",
        text="picture: .png, .svg or .pdf, or with --bodies a page: .html (default: map.png)",
        required=False,
    ),
    cli.unless_given("output", "map.png"),
    cli.path_option("--bodies", "FOLDER", "folder of the meshes, to show bodies"),
    cli.choice("--by", "label that the colours show", *_QUESTIONS),
    cli.choice(
        "--method", "method that places the points; t-sne needs riemhuman[report]", "mds", "t-sne"
    ),
)
def _plot(options: argparse.Namespace) -> cli.Answer:
    import numpy as np

    from riemhuman.io.label_tables import without_ending
    from riemhuman.plots import figures

    distances, names, labels = _read_matrix(options)
    items, class_names = np.zeros(len(names), dtype=int), None
    if labels:
        classes, items = np.unique(labels[options.by], return_inverse=True)
        class_names = [str(name) for name in classes]
    item_names = [without_ending(name) for name in names]
    positions = rh.plots.embed(distances, method=options.method)
    scale, unit, facts = _meaning(distances, positions, options.method)
    record = {"meshes": len(items), "method": options.method, **facts}
    meshes = None if options.bodies is None else _meshes_of(names, options.bodies)
    if options.ending == ".html":
        if meshes is None:
            raise ArgumentError("a page of a map shows bodies: give their folder with --bodies")
        rh.plots.view_map(
            *(positions, items, class_names),
            points=meshes[:],
            faces=meshes.faces,
            item_names=item_names,
            note=scale.replace("\n", " "),
            title=f"Map of {len(names)} bodies",
        ).save(options.output)
        return cli.Answer(record, record)
    if not labels:  # names of files stand beside their points; one body would not show a class
        meshes = None
    with figures.figure_style():
        ax = rh.plots.plot_embedding(
            positions,
            items,
            class_names,
            item_names=None if labels else item_names,
            points=None if meshes is None else meshes[:],
            faces=None if meshes is None else meshes.faces,
            unit=unit,
            ax=figures.new_figure(6.0, 5.0).subplots(),
        )
        ax.set_xlabel(scale)
        figures.save_figure(ax.figure, options.output)
    return cli.Answer(record, record)


def _meaning(
    distances: Array, positions: Array, method: str
) -> tuple[str, str | None, dict[str, object]]:
    """Return what distances on a map mean in two lines, their unit, if any, and both in numbers."""
    from riemhuman.plots import maps

    kept, count, by_chance = maps.neighbours_kept(distances, positions)
    facts: dict[str, object] = {"stress": None, "neighbours_kept": kept}
    neighbours = f"Of the {count} bodies nearest to each, the map keeps {100 * kept:.0f} %."
    if method != "mds":
        scale = "Near points are similar bodies (t-SNE). Distances have no unit."
        return f"{scale}\n{neighbours}", None, facts
    stress = rh.plots.stress(distances, positions)
    facts |= {"stress": stress, "fit": rh.plots.describe_stress(stress)}
    least_kept = by_chance + maps.LEAST_KEPT * (1 - by_chance)
    if stress > maps.LARGEST_STRESS and kept < least_kept:
        raise ArgumentError(
            f"a plane shows nothing of these distances: they are off by {100 * stress:.0f} %, and "
            f"of the {count} bodies nearest to each, a map keeps {100 * kept:.0f} %, where chance "
            f"keeps {100 * by_chance:.0f} %; riemhuman retrieve lists who is near to whom"
        )
    scale = f"Distances approximate those of the metric, in metres: off by {100 * stress:.0f} %."
    return f"{scale}\n{neighbours}", "m", facts


def _meshes_of(names: Sequence[str], folder: Path) -> RegisteredMeshes:
    """Return the meshes of a matrix, which a folder holds, in its order."""
    from riemhuman.io.label_tables import without_ending

    files = {without_ending(file.name): file for file in rh.datasets.find_meshes(folder)}
    missing = [name for name in names if without_ending(name) not in files]
    if missing:
        raise FileError(
            f"{folder} does not hold {len(missing)} of the {len(names)} meshes of the matrix, such "
            f"as {missing[0]}"
        )
    return rh.datasets.RegisteredMeshes([files[without_ending(name)] for name in names], scale=None)


@cli.command(
    "report",
    "Repeats the paper's experiments and writes a report into a folder: index.html, which\n"
    "needs no network connection, figures, tables, matrices and their provenance. The default\n"
    "data are the bundled open bodies. With --bodies, only sections that suit the data appear:\n"
    "measurements need one body, differences and paths need two, and retrieval needs people\n"
    "or poses with two bodies each. Without labels.csv, people and poses are unknown. Results\n"
    "of an earlier run are reused.",
    "  riemhuman report\n"
    "  riemhuman report --quick -o quick-report\n"
    "  riemhuman report --open natural -o natural-report\n"
    "  riemhuman report --faust ~/MPI-FAUST --dfaust registrations_m.hdf5 -o faust-report\n"
    "  riemhuman report --bodies bodies/ --labels bodies/labels.csv -o bodies-report\n",
    _BODY_SET,
    cli.path_option("--dfaust", "FILE", "motions of Dynamic FAUST for the basis of geodesics"),
    cli.path_option(
        "-o --output",
        "FOLDER",
        "folder to write (default: riemhuman-report)",
        default=Path("riemhuman-report"),
    ),
    cli.path_option("--scans", "FOLDER", "also show the scans registered into this folder"),
    cli.flag("--quick", "a smaller report, in half a minute"),
    cli.OUTPUT_UNITS,
)
def _report(options: argparse.Namespace) -> cli.Answer:
    for place in (options.bodies, options.faust, options.dfaust, options.scans):
        if place is not None and not place.exists():
            raise FileError(f"there is no file or folder {place}")
    import_matplotlib(extra="report")  # before the work, not after it
    motions = options.dfaust and rh.datasets.load_dfaust(options.dfaust)
    with options.task("Loading the bodies"):
        if _is_unlabelled(options):
            bodies = _unlabelled_bodies(options)
        else:
            bodies = _read_body_set(options, "coarse" if options.quick else "full")
    basis = None
    if motions:
        with options.task("Basis of Dynamic FAUST"):
            basis = rh.DeformationBasis.from_motions(motions, _N_COMPONENTS, progress=options.bars)
    settings = {"quick": options.quick, "scans": options.scans, "units": options.output_units}
    settings["progress"] = options.task
    page = rh.report.make_report(options.output, bodies=bodies, basis=basis, **settings)
    return cli.Answer(str(page), {"output": page})


def _is_unlabelled(options: argparse.Namespace) -> bool:
    """Return whether there is a folder of bodies without a table of labels."""
    if options.bodies is None or options.labels is not None:
        return False
    return options.bodies.is_dir() and not (options.bodies / "labels.csv").exists()


def _unlabelled_bodies(options: argparse.Namespace) -> Bodies:
    """Return bodies of unknown poses, each of a person of its own by the name of its file."""
    import numpy as np

    files = rh.datasets.find_meshes(options.bodies)
    meshes = rh.datasets.RegisteredMeshes(
        files, options.template or files[0], unit=options.unit, up=options.up
    )
    template = rh.Template(meshes.reference, meshes.faces)
    names = tuple(file.stem for file in files)
    terminal.note(f"{options.bodies} has no labels.csv: people and poses are unknown")
    return rh.datasets.Bodies(
        points=rh.procrustes(meshes[:], to=template.vertices, scale=None),
        subject=np.arange(len(files)),
        pose=np.arange(len(files)),
        template=template,
        subject_names=names,
        pose_names=("",) * len(files),
        ids=names,
    )
