"""The commands ``examples``, ``view`` and ``info``."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import riemhuman as rh
from riemhuman.cli import _commands as cli
from riemhuman.cli import _inputs as inputs
from riemhuman.errors import ArgumentError, FileError, FileFormatError

if TYPE_CHECKING:
    from riemhuman.arrays import Integers, JSONRecord, Points, Triangles
    from riemhuman.datasets import Motion, SkeletonMotion
    from riemhuman.plots import Viewer

_SKELETON_ENDINGS, _MARKER_ENDINGS = (".bvh", ".amc"), (".trc", ".c3d")

# The array path in a folder that `riemhuman geodesic` writes.
_PATH_FILE = "path.npz"
# Powers of the unit of the sizes in an answer.
_POWERS = {"extents": 1, "largest_extents": 1, "area": 2, "volume": 3}
# Archives may hold any number of arrays: those beyond this number are only counted.
_MOST_LISTED = 100


@cli.command(
    "examples",
    "Writes files of simulated people: registered bodies of eight people in ten poses with\n"
    "labels, raw scans with a floor and holes, two visits of one person, and a walk. The\n"
    "commands in the README and on the page about the command line run in this folder.",
    "  riemhuman examples people/    # then, there: riemhuman dist anna.ply ben.ply\n  "
    "riemhuman examples people/ --json\n",
    cli.path_option("folder", "FOLDER", "folder to write, which must not exist yet"),
)
def _examples(options: argparse.Namespace) -> cli.Answer:
    from riemhuman.cli._example_files import write_example_files
    from riemhuman.io.outputs import atomic_folder, check_parent

    if options.folder.exists():
        raise FileError(f"{options.folder} exists; name a folder that does not exist yet")
    check_parent(options.folder)
    with (
        options.task("Example files"),
        atomic_folder(options.folder) as temporary,
    ):
        contents = write_example_files(temporary)
    lines = [f"{names:32}{text}" for names, text in contents.items()]
    return cli.Answer("\n".join(lines), {"folder": options.folder, "contents": contents})


@cli.command(
    "view",
    "Writes a page that works in any browser without a network connection, a picture, or a film "
    "(GIF, or MP4 with the extra video) in which still bodies turn once. It shows registered "
    "meshes side by side, or one after the other with --motion; a raw scan over the body "
    "registered to it, with distances; the path in an .npz file or in the folder written by "
    "riemhuman geodesic; or a motion capture recording (.bvh, .amc, .trc, .c3d, .npz of AMASS, or "
    ".npz, .pkl and .pt of methods that track people in videos), performed by a body with its "
    "proportions.",
    "  riemhuman view anna.ply ben.ply                # opens in the browser\n"
    "  riemhuman view anna.ply ben.ply -o both.html\n"
    "  riemhuman view scan.ply body.ply               # a scan over its registered body\n"
    "  riemhuman view walk/ --motion -o walk.html\n"
    "  riemhuman view path/ -o path.html --open\n"
    "  riemhuman view anna.ply ben.ply -o both.png\n"
    "  riemhuman view walk.bvh -o walk.html\n"
    "  riemhuman view walk.bvh -o walk.mp4            # a film; .gif too\n",
    cli.path_option("meshes", "FILES", "meshes, folders, an .npz, or a recording", nargs="+"),
    cli.output(
        "FILE",
        ".html",
        ".png",
        ".gif",
        ".mp4",
        text="page, picture or film to write; without one, a temporary page opens in the browser",
        required=False,
        needs_matplotlib=False,
    ),
    cli.flag("--motion", "the meshes are the frames of one motion"),
    cli.flag("--open", "open the page in the browser"),
    cli.JOINTS,
    cli.FPS,
    cli.ANY_SCALE,
    cli.UNIT,
    cli.OUTPUT_UNITS,
)
def _view(options: argparse.Namespace) -> cli.Answer:
    first = options.meshes[0]
    if len(options.meshes) == 1 and (first / _PATH_FILE).is_file():
        first = first / _PATH_FILE
    with options.task("Page"):
        from riemhuman.mocap.recordings import RECORDING_ENDINGS  # takes long to import

        ending = first.suffix.lower()
        if ending in RECORDING_ENDINGS or inputs.is_recording(first):
            if len(options.meshes) > 1:
                raise ArgumentError(f"give either one {ending} file with a path, or meshes")
            motion, faces, timing = inputs.read_motion(first, options, is_shown=True)
            title = first.parent.resolve().name if first.name == _PATH_FILE else first.name
            viewer = rh.plots.view_path(motion, faces, title=title, keep_places=True, **timing)
        else:
            viewer = _view_of_meshes(options)
        page = inputs.save_or_open(viewer, options)
    return cli.Answer(record={}) if page is None else cli.Answer({"page": page}, {"page": page})


def _view_of_meshes(options: argparse.Namespace) -> Viewer:
    """Return a view of a scan over its body, of registered meshes, or of the frames of a motion."""
    from riemhuman.representation import join_names

    scan_and_body = _scan_and_body(options)
    if scan_and_body is not None:
        return _scan_over_body(*scan_and_body, options)
    surfaces = inputs.read_surfaces(options, options.meshes)
    names = [file.stem for file in surfaces.files]
    title = join_names(names) if len(names) < 4 else f"{names[0]} to {names[-1]}"
    if options.motion:
        return rh.plots.view_path(surfaces[:], surfaces.faces, title=title, keep_places=True)
    return rh.plots.view_bodies(surfaces[:], surfaces.faces, names, title=title)


def _scan_and_body(options: argparse.Namespace) -> tuple[Path, Path] | None:
    """Return the two files given, if they are a scan and its body: points, or other triangles."""
    import numpy as np

    files = options.meshes
    if len(files) != 2 or options.motion or any(map(_is_not_scan, files)):
        return None
    first, second = files
    first_points, first_faces, *_ = rh.io.load_points(first)
    second_points, second_faces, *_ = rh.io.load_points(second)
    if first_faces is None and second_faces is None:
        return None
    if first_faces is None or second_faces is None:
        return (first, second) if first_faces is None else (second, first)
    if np.array_equal(first_faces, second_faces):
        return None
    is_first_body = rh.io.is_registered_scan(first)
    is_second_body = rh.io.is_registered_scan(second)
    if not (is_first_body or is_second_body):
        is_first_body = _is_open_body(first_points, first_faces)
        is_second_body = _is_open_body(second_points, second_faces)
    is_first_only = is_first_body and not is_second_body
    return (second, first) if is_first_only else (first, second)


def _is_not_scan(file: Path) -> bool:
    return file.is_dir() or file.suffix.lower() not in rh.io.meshes.POINT_SUFFIXES


def _is_open_body(points: Points, faces: Triangles) -> bool:
    return rh.measurements.open_measurements(rh.Template(points, faces)) is not None


def _scan_over_body(scan: Path, body: Path, options: argparse.Namespace) -> Viewer:
    """Return the page of a scan over its body."""
    surface = rh.registration.load_scan(body)
    return rh.plots.view_scan(
        rh.registration.load_scan(scan, options.unit),
        surface.points,
        surface.faces,
        title=f"{scan.name} over {body.name}",
        system=options.output_units,
    )


@cli.command(
    "info",
    "Describes what other commands read: a mesh (PLY, OBJ, OFF, STL, GLB), a scan (also XYZ,\n"
    "NPY), a folder of meshes or of motions, an .npz file (body model, recording, or any\n"
    "arrays), measurements (JSON), labels or landmarks (CSV), an SMPL model's pickle (without\n"
    "running it), an HDF5 file of Dynamic FAUST or a recording (BVH, Acclaim, TRC, C3D, .smpl,\n"
    "or of methods that track people in videos), with the fields that are used and\n"
    "those that are ignored.",
    "  riemhuman info scan.ply            # closed? degenerate triangles? which unit?\n"
    "  riemhuman info scans/              # do they share one triangulation?\n"
    "  riemhuman info basis.npz --json\n",
    cli.path_option("file", "FILE", "file or folder"),
    cli.OUTPUT_UNITS,
)
def _info(options: argparse.Namespace) -> cli.Answer:
    facts = {"file": str(options.file), **_facts(options.file)}
    return cli.Answer(_with_units(facts, options.output_units), facts)


def _with_units(facts: JSONRecord, system: str) -> JSONRecord:
    """Return facts for readers: sizes in everyday units, by the likely unit of the file."""
    from riemhuman.checks import UNITS as UNITS_OF_FILES

    if "extents" in facts and "unit" in facts:  # of points, which are read in metres
        extents = _size("extents", facts["extents"], 1.0, system)
        return facts | {"extents": extents, "unit": f"{facts['unit']}, by its size"}
    if "unit_guess" not in facts:
        return facts
    guess = facts["unit_guess"]
    sizes = {name: facts[name] for name in _POWERS if facts.get(name) is not None}
    if guess in UNITS_OF_FILES:
        shown = {
            name: _size(name, size, UNITS_OF_FILES[guess], system) for name, size in sizes.items()
        }
    else:  # no unit, or either of two
        powers = ("", "", "²", "³")
        shown = {
            name: f"{_numbers(size)} units{powers[_POWERS[name]]}" for name, size in sizes.items()
        }
    return facts | shown | {"unit_guess": f"{guess}; the file names none"}


def _size(name: str, size: float | Sequence[float], per_metre: float, system: str) -> str:
    """Return lengths, an area or a volume of a file in everyday units."""
    import numpy as np

    from riemhuman.readable_units import readable_unit

    power = _POWERS[name]
    unit = readable_unit(("", "m", "m²", "m³")[power], system)
    values = np.atleast_1d(size) / per_metre**power * unit.scale
    return f"{', '.join(f'{value:,.{unit.digits}f}' for value in values)} {unit.name}"


def _numbers(size: float | Sequence[float]) -> str:
    import numpy as np

    return ", ".join(f"{value:.4g}" for value in np.atleast_1d(size))


def _facts(file: Path) -> JSONRecord:
    from riemhuman.io.files import suffix_of
    from riemhuman.io.meshes import MESH_SUFFIXES

    if not file.exists():
        raise FileError(f"there is no file or folder {file}")
    if file.is_dir():
        return _folder_facts(file)
    readers = {
        **dict.fromkeys(MESH_SUFFIXES, _mesh_facts),
        **dict.fromkeys((".xyz", ".npy"), _scan_facts),
        ".npz": _npz_facts,
        ".json": _measurement_facts,
        ".csv": _table_facts,
        **dict.fromkeys((".hdf5", ".h5"), _hdf5_facts),
        **dict.fromkeys(_SKELETON_ENDINGS, _skeleton_facts),
        **dict.fromkeys(_MARKER_ENDINGS, _marker_facts),
        **dict.fromkeys((".pkl", ".pickle"), _pickle_facts),
        **dict.fromkeys((".joblib", ".pt", ".pth", ".smpl"), _recording_facts),
    }
    return readers[suffix_of(file, readers)](file)


def _mesh_facts(file: Path) -> JSONRecord:
    vertices, faces = rh.load_mesh(file)
    if not len(faces):
        return _scan_facts(file)
    return {"kind": "mesh", **mesh_facts(vertices, faces)}


def _scan_facts(file: Path) -> JSONRecord:
    import numpy as np

    scan = rh.registration.load_scan(file)
    return {
        "kind": "scan: points without triangles",
        "points": len(scan),
        "normals": scan.normals is not None,
        "extents": np.ptp(scan.points, axis=0),
        "unit": scan.unit,
        "next": inputs.advice(file),
    }


def mesh_facts(vertices: Points, faces: Triangles) -> JSONRecord:
    """Return counts, sizes (in the unit of the file) and defects of a mesh by name."""
    import numpy as np

    from riemhuman.io.mesh_arrays import place_numbers
    from riemhuman.surfaces.measures import find_inward_triangles, vertex_components

    n_triangles, is_passed_once = _edge_uses(faces)
    is_used = np.zeros(len(vertices), dtype=bool)
    is_used[faces] = True
    part = vertex_components(faces, len(vertices))
    extents = np.ptp(vertices[is_used], axis=0)
    inward = find_inward_triangles(vertices, faces)
    is_closed = bool((n_triangles == 2).all())
    oriented = is_passed_once and bool(inward.all() or not inward.any())
    areas = rh.surfaces.triangle_areas(vertices, faces)
    sides = [vertices[faces[:, k]] - vertices[faces[:, k - 1]] for k in range(3)]
    longest_squared = np.max([np.einsum("fx,fx->f", side, side) for side in sides], axis=0)
    seams = rh.io.find_seams(vertices, faces)
    return {
        "vertices": len(vertices),
        "triangles": len(faces),
        "edges": len(n_triangles),
        "parts": np.count_nonzero(np.bincount(part[is_used])),
        "closed": is_closed,
        "boundary_edges": (n_triangles == 1).sum(),
        "non_manifold_edges": (n_triangles > 2).sum(),
        "consistently_oriented": oriented,
        "triangles_facing_inward": inward.sum(),
        "unused_vertices": (~is_used).sum(),
        "coincident_vertices": len(vertices) - 1 - place_numbers(vertices).max(),
        "seam_edges": len(seams.edge_pairs),
        # Those whose height is zero up to rounding.
        "degenerate_triangles": (2 * areas <= 1e-12 * longest_squared).sum(),
        "extents": extents,
        "area": areas.sum(),
        "volume": float(rh.surfaces.signed_volume(vertices, faces))
        if is_closed and oriented
        else None,
        "unit_guess": _likely_unit(max(extents)),
        "usable_as_template": _use_as_template(vertices, faces, seams),
    }


def _likely_unit(extent: float) -> str:
    from riemhuman.checks import likely_units

    return " or ".join(likely_units(extent)) or "none: no human body has this size"


def _edge_uses(faces: Triangles) -> tuple[Integers, bool]:
    """Return how many triangles share each edge, and whether they are oriented consistently."""
    import numpy as np

    starts, ends = faces.T.ravel(), faces[:, [1, 2, 0]].T.ravel()
    # One number per directed edge, because sorting pairs takes many times as long.
    keys = np.minimum(starts, ends) * (int(faces.max()) + 1) + np.maximum(starts, ends)
    keys = np.sort(2 * keys + (starts > ends))
    is_passed_once = bool((np.diff(keys) != 0).all())
    first = np.flatnonzero(np.diff(keys >> 1, prepend=-1))
    return np.diff(first, append=len(keys)), is_passed_once


def _use_as_template(vertices: Points, faces: Triangles, seams: rh.io.Seams) -> str:
    try:
        rh.Template(vertices, faces)
    except ArgumentError as error:
        return f"no: {error}"
    if seams:
        return f"yes, once its seams are joined: {seams.n_copies} duplicated vertices"
    return "yes"


def _folder_facts(folder: Path) -> JSONRecord:
    import numpy as np

    try:
        files = rh.datasets.find_meshes(folder)
    except FileError:
        motions = rh.datasets.load_mesh_motions(folder)
        names = [f"{motion.sequence}: {len(motion):,} frames" for motion in motions]
        return {"kind": "folder of motions", "motions": names}
    facts: JSONRecord = {"kind": "folder of meshes", "meshes": len(files)}
    facts |= {"first": files[0].name, "last": files[-1].name}
    try:
        meshes = rh.datasets.RegisteredMeshes(files)
        points = meshes[:]
    except FileFormatError as error:
        advised = inputs.advice(folder).replace("body.ply", "bodies/")
        return facts | {"registered": f"no: {error}", "next": advised}
    return facts | {
        "registered": True,
        "vertices": points.shape[1],
        "seams_joined": 0 if meshes.seams is None else len(meshes.seams.edge_pairs),
        "triangles": len(meshes.faces),
        "largest_extents": np.ptp(points, axis=1).max(axis=0),
        "unit_guess": _likely_unit(np.ptp(points, axis=1).max()),
    }


def _npz_facts(file: Path) -> JSONRecord:
    from riemhuman.io.arrays import array_names

    names = set(array_names(file))
    if names & {"mocap_framerate", "mocap_frame_rate"}:
        (motion,) = rh.datasets.load_amass(file)
        return {"kind": "motion of AMASS", **_times(motion), **_fields_of_recording(file)}
    if {"v_template", "shapedirs"} <= names:
        return _model_facts(file)
    if "pred_vertices" in names:
        return _photograph_facts(file, names)
    from riemhuman.mocap.recordings import POSE_FIELDS

    if names & POSE_FIELDS:
        with suppress(FileFormatError):  # arrays of other programs, under one of these names
            return _recording_facts(file)
    return _array_facts(file)


def _array_facts(file: Path) -> JSONRecord:
    from riemhuman.io.arrays import array_headers, array_names

    every_name = array_names(file)
    headers = array_headers(file, every_name[:_MOST_LISTED])
    facts = {"kind": "arrays"}
    facts |= {name: f"{dtype} {shape}" for name, (shape, dtype) in headers.items()}
    n_others = len(every_name) - len(headers)
    return facts | ({"others": f"{n_others:,} more arrays"} if n_others else {})


def _photograph_facts(file: Path, names: set[str]) -> JSONRecord:
    from riemhuman.io.arrays import array_headers

    shape, _ = array_headers(file, ("pred_vertices",))["pred_vertices"]
    if len(shape) < 2 or shape[-1] != 3:
        raise FileFormatError(
            f"{file}: pred_vertices of SAM 3D Body must have shape (V, 3) or (n, V, 3); found "
            f"{shape}"
        )
    expected = ("pred_cam_t", "pred_keypoints_3d", "shape_params")
    return {
        "kind": "bodies of SAM 3D Body",
        "vertices": shape[-2],
        "lacks": ", ".join(["triangles", *(field for field in expected if field not in names)]),
        "next": f"riemhuman convert {file} -o body.ply --faces MESH",
    }


def _model_facts(file: Path) -> JSONRecord:
    model = rh.BodyModel.from_file(file)
    contents = rh.bodies.model_contents(file)
    return {
        "kind": "body model",
        "vertices": model.n_vertices,
        "triangles": len(model.faces),
        "joints": model.n_joints,
        "shape_coefficients": model.n_betas,
        "pose_blend_shapes": model.posedirs is not None,
        "joint_names": ", ".join(model.joint_names),
        "family": contents.family,
        "used": ", ".join(contents.used),
        "left_out": ", ".join(contents.left_out) or "nothing",
    }


def _measurement_facts(file: Path) -> JSONRecord:
    import json

    from riemhuman.io.files import format_errors, read_text

    kind = "definitions of measurements"
    with format_errors(file, kind):
        fields = json.loads(read_text(file))
        names = [str(measurement["name"]) for measurement in fields["measurements"]]
        sizes = {"vertices": int(fields["n_vertices"]), "triangles": int(fields["n_faces"])}
    return {"kind": kind, **sizes, "measurements": names}


def _table_facts(file: Path) -> JSONRecord:
    from riemhuman.io.label_tables import label_columns
    from riemhuman.io.text_tables import read_rows

    _, rows = read_rows(file)
    columns = rows[0][1] if rows else []
    is_labels = {"file", "subject"} <= label_columns(columns).keys()
    kind = "table of labels" if is_labels else "table"
    return {"kind": kind, "columns": columns, "rows": max(0, len(rows) - 1)}


def _hdf5_facts(file: Path) -> JSONRecord:
    motions = rh.datasets.load_dfaust(file)
    return {
        "kind": "motions of Dynamic FAUST",
        "motions": len(motions),
        "people": sorted({motion.subject for motion in motions}),
        "frames": sum(map(len, motions)),
        "vertices": int(motions[0].faces.max()) + 1,
        "triangles": len(motions[0].faces),
        "sequences": [f"{m.subject}_{m.sequence}: {len(m):,} frames" for m in motions],
    }


def _pickle_facts(file: Path) -> JSONRecord:
    """Return facts of a recording, or if the file holds none, of a body model."""
    try:
        return _recording_facts(file)
    except rh.errors.FileFormatError:
        return _model_facts(file)


def _recording_facts(file: Path) -> JSONRecord:
    try:
        times = _times(rh.datasets.load_recording(file))
    except FileFormatError:
        motion = rh.datasets.load_recording(file, frames_per_second=1.0)
        times = {"frames": len(motion), "frames_per_second": "not stated"}
    return {"kind": "recording of poses", **times, **_fields_of_recording(file)}


def _fields_of_recording(file: Path) -> dict[str, str]:
    contents = rh.datasets.recording_contents(file)
    return {
        "used": ", ".join(contents.used),
        "left_out": ", ".join(contents.left_out) or "nothing",
    }


def _skeleton_facts(file: Path) -> JSONRecord:
    load = rh.datasets.load_amc if file.suffix.lower() == ".amc" else rh.datasets.load_bvh
    motion = load(file)
    return {
        "kind": "motion capture recording",
        "joints": len(motion.joint_names),
        **_times(motion),
        "joint_names": ", ".join(motion.joint_names),
    }


def _marker_facts(file: Path) -> JSONRecord:
    from riemhuman.mocap.markers import read_markers

    load = rh.datasets.load_trc if file.suffix.lower() == ".trc" else rh.datasets.load_c3d
    markers = read_markers(file)
    try:
        joints = ", ".join(load(file).joint_names)
    except FileFormatError as error:
        joints = f"none: {error}"
    n_frames, n_markers = markers.positions.shape[:2]
    return {
        "kind": "recording of markers",
        "markers": n_markers,
        "frames": n_frames,
        "frames_per_second": markers.frames_per_second,
        "seconds": n_frames / markers.frames_per_second,
        "marker_names": ", ".join(markers.names),
        "joints": joints,
    }


def _times(motion: Motion | SkeletonMotion) -> JSONRecord:
    rate = motion.frames_per_second
    return {"frames": len(motion), "frames_per_second": rate, "seconds": len(motion) / rate}
