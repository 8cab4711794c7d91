"""Registered meshes, metrics and bases that commands read, and the motions that they write."""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import riemhuman as rh
from riemhuman.cli import _commands as cli
from riemhuman.cli._terminal import as_json, note
from riemhuman.errors import ArgumentError

if TYPE_CHECKING:
    from riemhuman.arrays import Array, JSONRecord, Points, Triangles
    from riemhuman.bodies import BodyModel
    from riemhuman.datasets import Motion, RegisteredMeshes
    from riemhuman.geometry import RiemannianMetric
    from riemhuman.measurements import Measurements
    from riemhuman.mocap.motions import ModelMotion
    from riemhuman.plots import Viewer
    from riemhuman.surfaces import DeformationBasis, Template

# Triples of a, λ and c.
_PRESETS = {"shape": (1.0, 1e-4, 0.0), "pose": (0.0, 0.0, 1.0)}
PATH_METRIC = (1.0, 1.0, 0.1)  # limbs would shrink along paths of the shape metric
_N_HARMONICS = 60
# Frames per second of recordings: enough to play smoothly, and for movements of a body.
_RECORDED_RATE = 30.0
_SHOWN_RATE = 60.0
_SUMMARY = "summary.json"
_PATH_ENDINGS = (".glb", ".png", ".html", ".npz")
_MOST_IN_STRIP = 12


def is_recording(file: Path) -> bool:
    """Return whether a file is a recording rather than an array path, by its ending and content."""
    from riemhuman.mocap.joint_positions import has_joints, is_table_of_joints
    from riemhuman.mocap.recordings import RECORDING_ENDINGS

    ending = file.suffix.lower()
    if ending == ".npy" and file.is_file():
        return has_joints(rh.io.load_array(file, mode="r"))
    if ending == ".csv" and file.is_file():
        return is_table_of_joints(file)
    if ending == ".glb" and file.is_file():
        from riemhuman.io.gltf_animation import has_animation

        return has_animation(file.read_bytes())
    if ending != ".npz":
        return ending in RECORDING_ENDINGS
    return not rh.io.load_arrays(file, (), ("path",))


def load_recording(
    file: Path,
    options: argparse.Namespace,
    model: BodyModel | None = None,
    frames_per_second: float | None = None,
) -> ModelMotion:
    """Return a recording, with the joints and the frame rate that options give."""
    from riemhuman.io.files import format_errors, read_text

    joints = None
    if options.joints is not None:
        with format_errors(options.joints, "names of joints"):
            joints = json.loads(read_text(options.joints))
            if not isinstance(joints, dict):
                raise ArgumentError('must hold names of joints: {"left_knee": "LKNE", ...}')
    rate = options.fps if frames_per_second is None else frames_per_second
    return rh.datasets.load_recording(file, model, joints=joints, frames_per_second=rate)


def read_motion(
    file: Path, options: argparse.Namespace, *, is_mean: bool = False, is_shown: bool = False
) -> tuple[Motion | Points, Triangles, JSONRecord]:
    """Return the frames in a file, their triangles, and what a page says of a recording's time.

    To be shown, recordings are performed by the full model, at the rate of a screen.
    """
    if not is_recording(file):
        arrays = rh.io.load_arrays(file, ("path", "faces"))
        return arrays["path"], arrays["faces"], {}
    model = rh.datasets.load_open_model("full") if is_shown else None
    rate = _SHOWN_RATE if is_shown else _RECORDED_RATE
    motion = load_recording(file, options, model)
    timing: JSONRecord = {}
    if motion.frames_per_second > rate and options.fps is None:
        timing["description"] = (
            f"{rate:g} of the {motion.frames_per_second:g} frames recorded per second."
        )
        motion = load_recording(file, options, model, rate)
    # An average adult performs recordings of skeletons; for comparisons of movements, all others.
    if is_mean:
        motion = motion.performed_by([0.0] * motion.model.n_betas)
    return motion, motion.faces, timing | {"frames_per_second": motion.frames_per_second}


class Surfaces:
    """Registered surfaces in files, which are read and aligned when they are accessed."""

    def __init__(self, meshes: RegisteredMeshes, align: bool) -> None:
        self.files, self.faces = meshes.files, meshes.faces
        self.template = rh.Template(meshes.reference, meshes.faces)
        self.are_scans = any(map(rh.io.is_registered_scan, meshes.files))
        self._meshes, self._align = meshes, align

    def __len__(self) -> int:
        return len(self.files)

    def __getitem__(self, part: int | slice[int | None, int | None, int | None]) -> Points:
        points: Points = self._meshes[part]
        if self._align:
            points = rh.procrustes(points, to=self.template.vertices, scale=None)
        return points


def read_surfaces(options: argparse.Namespace, paths: Sequence[Path]) -> Surfaces:
    """Return the surfaces in mesh files and folders; by default, the first is the template."""
    from riemhuman.checks import is_human_size

    files = list_meshes(paths)
    meshes = rh.datasets.RegisteredMeshes(
        files,
        options.template,
        None if options.any_scale else "template",
        unit=options.unit,
        up=options.up,
    )
    size = (meshes.reference.max(axis=0) - meshes.reference.min(axis=0)).max()
    if options.unit and not (options.any_scale or is_human_size(size)):
        raise ArgumentError(
            f"{options.template or files[0]} would be {size:.3g} m long; --unit {options.unit} is "
            "wrong, or --any-scale is missing"
        )
    return Surfaces(meshes, options.align)


def list_meshes(paths: Sequence[Path]) -> list[Path]:
    """Return mesh files: those that are named, and those of folders in natural order."""
    files: list[Path] = []
    for place in paths:
        if place.suffix.lower() in (".xyz", ".npy"):
            raise ArgumentError(f"{place} holds points without triangles; {advice(place)}")
        files += rh.datasets.find_meshes(place) if place.is_dir() else [place]
    return files


MEASURED_MODEL = cli.several(
    cli.path_option("--model", "NPZ", "body model of the meshes (default: the open one)"),
    cli.path_option(
        "--definitions", "JSON", "measurements of the model (default: the open model's)"
    ),
    cli.needs("--definitions", "--model NPZ"),
)


def measurements_of(
    options: argparse.Namespace, template: rh.Template, file: Path, pose: str = "standing"
) -> Measurements:
    """Return the measurements of the chosen body model, by default of the open one."""
    if options.model is not None:
        model = rh.BodyModel.from_file(options.model)
        model.template.check_faces(template.faces, str(file))
        return rh.measurements.Measurements(model, options.definitions)
    definitions = rh.measurements.open_measurements(template, pose)
    if definitions is None:
        raise ArgumentError(
            f"{file} has {template.n_vertices:,} vertices and {template.n_faces:,} triangles, "
            f"unlike the open body model; {advice(file)}, or give --model and --definitions"
        )
    return rh.measurements.Measurements(definitions)


def advice(scan: Path) -> str:
    """Return advice on what to do with a scan, for messages."""
    return f"register it first: riemhuman register {scan} -o body.ply"


def metric_options(
    reference: str, default: tuple[float, float, float] = _PRESETS["shape"]
) -> cli.Argument:
    """Return the declaration of the template, alignment and metric, with default weights."""
    a, lam, c = default
    name = f"-a {a:g} -l {lam:g} -c {c:g}"

    def preset(name: str, text: str) -> cli.Argument:
        return cli.option(f"--{name}", text, dest="metric", action="store_const", const=name)

    def weight(flags: str, text: str, value: float, metavar: str) -> cli.Argument:
        return cli.option(flags, f"{text} (default: {value:g})", type=float, metavar=metavar)

    presets = [
        preset("shape", "compares people: (a, λ, c) = (1, 0.0001, 0)"),
        preset("pose", "compares poses: (a, λ, c) = (0, 0, 1)"),
        preset("srnf", "square root normal fields, for comparison"),
    ]
    if default == _PRESETS["shape"]:  # the command computes distances, not paths
        name = "--person for bodies of riemhuman register, else --shape"
        presets.insert(1, preset("person", "compares people who were scanned: PersonMetric"))
        presets.insert(2, preset("area", "areas of body parts: AreaMetric"))
    extension = cli.option(
        "--metric",
        "metric of another package, see riemhuman.extensions",
        dest="extension",
        metavar="NAME",
    )
    metric = cli.several(
        cli.several(*presets, extension, exclusive=True),
        weight("-a", "weight of the metric part", a, "A"),
        weight("-l --lam", "weight λ of area within the metric part", lam, "LAMBDA"),
        weight("-c", "weight of the normal part", c, "C"),
        lambda parser: parser.set_defaults(default_metric=default),
        title="metric",
        text=f"a · Ebin(λ) + c · normals (default: {name});\n-a, -l and -c change one weight each",
    )
    return cli.several(cli.template(reference), cli.ALIGN, metric)


def chosen_metric(
    options: argparse.Namespace, template: Template, *, are_scans: bool = False
) -> RiemannianMetric:
    """Return the metric that the options choose; by default that of people if they were scanned."""
    # Surfaces share a unit: this is checked when they are read.
    space = rh.AlignedSurfaces(template, equip=False, scale=None)
    weights = {"-a": options.a, "-l": options.lam, "-c": options.c}
    flags = ", ".join(flag for flag, weight in weights.items() if weight is not None)
    is_added = options.extension is not None
    chosen = f"metric {options.extension}" if is_added else options.metric
    if chosen and flags:
        raise ArgumentError(f"--{chosen} sets all weights; leave it out, or leave out {flags}")
    if is_added:
        added: RiemannianMetric = rh.extensions.extension("metrics", options.extension)(space)
        return added
    if options.metric == "srnf":
        return rh.SRNFMetric(space)
    if options.metric == "person":
        return rh.retrieval.benchmarks.person_metric(space, options.task)
    by_default = are_scans and not (options.metric or flags)
    if by_default:
        with suppress(ArgumentError):  # of bodies with other triangles than the open model's
            return rh.PersonMetric(space)
    if options.metric == "area" or by_default:
        return rh.AreaMetric(space)
    preset_weights = _PRESETS.get(options.metric, options.default_metric)
    pairs = zip(weights.values(), preset_weights, strict=True)
    return rh.ElasticMetric(space, *(preset if given is None else given for given, preset in pairs))


def metric_of_people(options: argparse.Namespace, surfaces: Surfaces) -> RiemannianMetric:
    """Return the metric that the options choose for surfaces; report a choice made for scans."""
    metric = chosen_metric(options, surfaces.template, are_scans=surfaces.are_scans)
    chosen: dict[str, type[RiemannianMetric]] = {"person": rh.PersonMetric, "area": rh.AreaMetric}
    for name, cls in chosen.items():
        if isinstance(metric, cls) and options.metric != name and not options.quiet:
            note(
                f"these are registered scans, so people are compared by {cls.__name__} "
                f"(--{name}), which hardly depends on noise; --shape uses the paper's metric"
            )
    return metric


def metric_in_words(metric: RiemannianMetric) -> str:
    """Return the name of a metric for readers."""
    if isinstance(metric, rh.ElasticMetric):
        return f"the elastic metric with (a, λ, c) = ({metric.a:g}, {metric.lam:g}, {metric.c:g})"
    return f"the metric {metric}"


def metric_record(metric: RiemannianMetric) -> JSONRecord:
    """Return the name and the parameters of a metric, for JSON."""
    names = ("a", "lam", "c", "time")
    weights = {name: getattr(metric, name) for name in names if hasattr(metric, name)}
    return {"name": type(metric).__name__, **weights}


BASIS = cli.several(
    cli.path_option("--basis", "NPZ", "basis of deformations (default: mesh harmonics)"),
    cli.option(
        "--n-components", f"mesh harmonics (default: {_N_HARMONICS})", type=int, metavar="K"
    ),
    exclusive=True,
)


def chosen_basis(options: argparse.Namespace, template: Template) -> DeformationBasis:
    """Return the basis that the options choose; raise an error if it does not fit the template."""
    basis: DeformationBasis
    if options.basis is None:
        count = _N_HARMONICS if options.n_components is None else options.n_components
        with options.task(f"{count} mesh harmonics"):
            basis = rh.DeformationBasis.from_laplacian(template, count)
        return basis
    basis = rh.DeformationBasis.load(options.basis)
    try:
        basis.check_fits(template)
    except ArgumentError as error:
        raise ArgumentError(f"{options.basis}: {error}") from error
    return basis


def path_output(mesh: str, *pages: str) -> cli.Argument:
    """Return the declaration of a path to write: a file, or a folder of meshes and of pages."""
    written = "|".join(map(re.escape, (*pages, _SUMMARY)))
    text = (
        "folder to write, or only an animation with morph targets (.glb), a film strip (.png), an "
        "interactive page (.html) or the array path (.npz)"
    )
    has_figure = any(name.endswith(".png") for name in pages)
    return cli.several(
        cli.output(
            "PATH",
            *_PATH_ENDINGS,
            text=text,
            names=rf"{mesh}_\d{{4,}}\.ply|{written}",
            always=pages[0],
        ),
        lambda parser: parser.set_defaults(mesh=mesh, pages=pages, has_figure=has_figure),
    )


MOTION_OUTPUT = path_output("frame", "motion.html")


def write_path(
    options: argparse.Namespace,
    path: Points,
    faces: Triangles,
    title: str,
    description: str = "",
    *,
    summary: cli.Record | None = None,
    **arrays: Array,
) -> None:
    """Write an animation, a film strip, a page or arrays, or a folder of meshes with such files."""

    def write(file: Path) -> None:
        ending = file.suffix.lower()
        if ending == ".glb":
            rh.save_glb(file, path, faces, name=title)
        elif ending == ".png":
            from riemhuman.plots import figures

            axes = figures.new_figure(12.0, 2.4).subplots()
            strip = rh.plots.plot_path(path, faces, n_shown=_MOST_IN_STRIP, ax=axes)
            figures.save_figure(figures.strip_figure(strip), file)
        elif ending == ".html":
            page = rh.plots.view_path(
                path, faces, title=title, description=description, keep_places=True
            )
            page.save(file)
        else:
            rh.io.save_arrays(file, {"path": path, "faces": faces, **arrays})

    with options.task("Output"):
        if options.ending:
            write(options.output)
            return
        meshes = {f"{options.mesh}_{number:04d}.ply": f for number, f in enumerate(path)}
        with mesh_folder(options, meshes, faces, summary) as folder:
            for name in options.pages:
                write(folder / name)


@contextmanager
def mesh_folder(
    options: argparse.Namespace,
    meshes: Mapping[str, Points],
    faces: Triangles,
    summary: cli.Record | None = None,
) -> Iterator[Path]:
    """Write meshes by the names of their files, and a record, into a folder that takes more."""
    from riemhuman.io.outputs import atomic_folder

    with atomic_folder(options.output, options.content) as folder:
        for name, surface in meshes.items():
            rh.save_mesh(folder / name, surface, faces)
        if summary is not None:
            (folder / _SUMMARY).write_text(as_json(summary) + "\n", encoding="utf-8")
        yield folder


def save_or_open(viewer: Viewer, options: argparse.Namespace) -> Path | None:
    """Write a view to the output or, without one, open a temporary page and return its place."""
    import tempfile
    import webbrowser

    place: Path | None = options.output
    if place is None:
        place = Path(tempfile.mkdtemp(prefix="riemhuman-")) / "view.html"
    viewer.save(place, progress=options.bars)
    if options.output is None or getattr(options, "open", False):
        webbrowser.open(place.resolve().as_uri())
    return place if options.output is None else None


class Motions(NamedTuple):
    """Motions of one triangulation, whose frames are read when needed, and their template."""

    names: Sequence[str]
    motions: Sequence[Motion | Array]
    template: Template


def read_motions(
    options: argparse.Namespace, *places: Path, **choice: Sequence[str] | None
) -> Motions:
    """Return motions in files and folders, those of Dynamic FAUST by people and sequences."""
    from riemhuman.io.files import visible_files

    if (options.unit or options.up) and not any(place.is_dir() for place in places):
        raise ArgumentError("--unit and --up are for folders of meshes; other files are in metres")
    from riemhuman.mocap.recordings import RECORDING_ENDINGS

    units = {"unit": options.unit, "up": options.up}
    loaded_motions: list[tuple[str, Motion | Points, Triangles]] = []
    for place in places:
        files = [place]
        is_hdf5 = place.suffix.lower() in (".hdf5", ".h5")
        if place.is_dir():
            files = visible_files(place, *RECORDING_ENDINGS, *cli.MESH_ENDINGS, deep=True)
            is_hdf5 = bool(visible_files(place, ".hdf5"))
        recorded = [file for file in files if file.suffix.lower() in RECORDING_ENDINGS]
        if any(choice.values()) and not is_hdf5:
            raise ArgumentError(f"--subjects and --sequences choose from HDF5 files; found {place}")
        if recorded and not any(file.suffix.lower() in cli.MESH_ENDINGS for file in files):
            loaded_motions += [
                (file.stem, *read_motion(file, options, is_mean=True)[:2]) for file in recorded
            ]
        else:
            load = rh.datasets.load_dfaust if is_hdf5 else rh.datasets.load_mesh_motions
            loaded = load(place, **(choice if is_hdf5 else units))
            loaded_motions += [(motion.sequence, motion, motion.faces) for motion in loaded]
    names = [name for name, _, _ in loaded_motions]
    motions = [motion for _, motion, _ in loaded_motions]
    if options.template is None:
        source, first_motion, faces = loaded_motions[0]
        body = rh.Template(first_motion[0], faces)
    else:
        meshes = rh.datasets.RegisteredMeshes([options.template], **units)
        source = options.template.name
        body = rh.Template(meshes.reference, meshes.faces)
    for name, _, faces in loaded_motions:
        body.check_faces(faces, f"with {source} as the template, the triangles of {name}")
    return Motions(names, motions, body)
