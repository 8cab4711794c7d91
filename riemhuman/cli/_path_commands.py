"""The commands ``geodesic``, ``mean`` and ``components``."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import riemhuman as rh
from riemhuman.cli._commands import (
    ALIGN,
    FILES,
    MESH_ENDINGS,
    PICTURE,
    Answer,
    command,
    mesh,
    names_matching,
    option,
    output,
    template,
)
from riemhuman.cli._inputs import (
    BASIS,
    PATH_METRIC,
    chosen_basis,
    chosen_metric,
    metric_name,
    metric_options,
    metric_record,
    read_surfaces,
    save_figure,
)
from riemhuman.cli._terminal import as_json, convergence, outcome
from riemhuman.errors import ArgumentError

if TYPE_CHECKING:
    from numpy import ndarray

_SUMMARY = "summary.json"
_COMPONENTS_PAGE = "components.html"
_COMPONENTS_METRIC = (1.0, 1.0, 0.0)  # with a much smaller λ, triangles have no logarithm
_DEVIATIONS = 2.0
_SIDES = {"minus": -_DEVIATIONS, "plus": _DEVIATIONS}
_IS_OF_GEODESIC = names_matching(r"time_\d+\.ply|path\.(glb|png|html)|summary\.json")
_IS_OF_COMPONENTS = names_matching(
    r"(mean|component_\d+_(minus|plus)|sample_\d{4,})\.ply|components\.html|summary\.json"
)


def _write_glb(file: Path, path: ndarray, faces: ndarray, description: str) -> None:
    rh.save_glb(file, path, faces)


def _write_png(file: Path, path: ndarray, faces: ndarray, description: str) -> None:
    save_figure(rh.plots.plot_path(path, faces).figure, file)


def _write_html(file: Path, path: ndarray, faces: ndarray, description: str) -> None:
    title = "Geodesic between two bodies"
    rh.plots.view_path(path, faces, title=title, description=description).save(file)


def _write_npz(file: Path, path: ndarray, faces: ndarray, description: str) -> None:
    rh.io.save_arrays(file, {"path": path, "faces": faces})


_WRITERS: dict[str, Callable[[Path, ndarray, ndarray, str], None]] = {
    ".glb": _write_glb,
    ".png": _write_png,
    ".html": _write_html,
    ".npz": _write_npz,
}


@command(
    "geodesic",
    "a path of least energy between two registered meshes",
    "Finds a path of least energy between two meshes over a basis of deformations.\n"
    "Writes a folder with the meshes time_00.ply, time_01.ply, ..., path.glb (an animation\n"
    "with morph targets, for Blender and web viewers), path.png (a filmstrip), path.html\n"
    "(an interactive page) and summary.json. If the output ends in .glb, .png, .html or\n"
    ".npz (the array path), writes only that file.",
    "  riemhuman geodesic sit.ply stand.ply -o path/\n"
    "  riemhuman geodesic sit.ply stand.ply -o path.glb --n-nodes 21\n"
    "  riemhuman geodesic a.ply b.ply -o path/ --basis basis.npz -a 1 -l 1 -c 0 --json\n",
    mesh("a_file", "A", "mesh to start from"),
    mesh("b_file", "B", "mesh to end at"),
    output(
        "PATH",
        *_WRITERS,
        text="folder or file to write",
        is_ours=_IS_OF_GEODESIC,
    ),
    option("--n-nodes", "surfaces of the path", default=11, metavar="N"),
    BASIS,
    template("A"),
    ALIGN,
    metric_options(PATH_METRIC),
)
def _geodesic(options: argparse.Namespace) -> Answer:
    from riemhuman.io.outputs import atomic_folder
    from riemhuman.optional import import_optional

    if options.ending in ("", ".png"):
        import_optional("matplotlib", "plot")  # before the work, not after it
    surfaces = read_surfaces(options, [options.a_file, options.b_file])
    metric = chosen_metric(options, surfaces.template)
    basis = chosen_basis(options, surfaces.template)
    solver = rh.solvers.BasisPath(basis, options.n_nodes, progress=options.bars)
    start = time.perf_counter()
    with options.task(f"Geodesic, {metric_name(metric)}"):
        result = solver.solve(metric, *surfaces[:])
    record = {
        "from": options.a_file,
        "to": options.b_file,
        "metric": metric_record(metric),
        "n_nodes": len(result.path),
        "energy": result.energy,
        "length": float(metric.length(result.path)),
        "distance": float(metric.dist(result.path[0], result.path[-1])),
        "energies": result.energies,
        **outcome(result),
        "seconds": time.perf_counter() - start,
    }
    description = (
        f"From {options.a_file.name} to {options.b_file.name} in {len(result.path)} surfaces: "
        f"a path of least energy under the metric {metric_name(metric)}. Energy "
        f"{result.energy:.4g}, length {record['length']:.4g}\u00a0m; no path is shorter than "
        f"{record['distance']:.4g}\u00a0m. Converged: {convergence(result)}."
    )
    faces = surfaces.faces
    if options.ending:
        _WRITERS[options.ending](options.output, result.path, faces, description)
    else:
        with atomic_folder(options.output, _IS_OF_GEODESIC) as folder:
            with options.task("Meshes"):
                digits = max(2, len(str(len(result.path) - 1)))
                for number, surface in enumerate(result.path):
                    rh.save_mesh(folder / f"time_{number:0{digits}d}.ply", surface, faces)
            for kind, name in ((".glb", "Animation"), (".png", "Filmstrip"), (".html", "Page")):
                with options.task(name):
                    _WRITERS[kind](folder / f"path{kind}", result.path, faces, description)
            (folder / _SUMMARY).write_text(as_json(record) + "\n", encoding="utf-8")
    text = {
        "energy": f"{result.energy:.8g}",
        "length": f"{record['length']:.8g}",
        "distance": f"{record['distance']:.8g}  (a lower bound of the length)",
        "converged": convergence(result),
    }
    return Answer(text, record, trusted=bool(result.converged))


@command(
    "mean",
    "the Karcher mean of registered meshes",
    "Writes the body with the least mean squared distance from the meshes, searched over a\n"
    "basis of deformations and the differences of the meshes.",
    "  riemhuman mean anna.ply ben.ply carl.ply -o mean.ply --align\n"
    "  riemhuman mean scans/ -o mean.obj --pose --picture mean.html\n"
    "  riemhuman mean scans/ -o mean.ply --basis basis.npz -a 1 -l 1 -c 0.1 --json\n",
    FILES,
    output("MESH", *MESH_ENDINGS),
    BASIS,
    template("the first mesh"),
    ALIGN,
    metric_options(PATH_METRIC),
    PICTURE,
)
def _mean(options: argparse.Namespace) -> Answer:
    with options.task("Reading the meshes"):
        surfaces = read_surfaces(options, options.meshes)
        points = surfaces[:]
    metric = chosen_metric(options, surfaces.template)
    basis = chosen_basis(options, surfaces.template)
    with options.task(f"Mean of {len(points)}, {metric_name(metric)}"):
        result = rh.solvers.BasisMean(basis, progress=options.bars).solve(metric, points)
    rh.save_mesh(options.output, result.point, surfaces.faces)
    shown = None
    if options.picture is not None:
        names = [*(file.stem for file in surfaces.files), "Karcher mean"]
        bodies, title = [*points, result.point], "Meshes and their mean"
        shown = rh.plots.save_picture(
            options.picture, bodies, surfaces.faces, names, title=title, mean=True
        )
    record = {
        "files": surfaces.files,
        "metric": metric_record(metric),
        "variance": result.variance,
        "variances": result.variances,
        **outcome(result),
    }
    text = {
        "variance": f"{result.variance:.8g}  (mean squared distance)",
        "converged": convergence(result),
        "picture": shown,
    }
    return Answer(text, record, trusted=bool(result.converged))


@command(
    "components",
    "principal components of registered meshes, and new bodies",
    "Finds the directions in which meshes differ most, by principal component analysis of\n"
    "their logarithms at the Karcher mean. Writes a folder with the mean (mean.ply), the\n"
    "bodies two standard deviations from it along each component (component_1_minus.ply,\n"
    "component_1_plus.ply, ...), random bodies (sample_0000.ply, ...), a page that shows\n"
    "them (components.html), and summary.json.",
    "  riemhuman components scans/ -o components/\n"
    "  riemhuman components scans/ -o components/ -n 5 --samples 20 --seed 7\n"
    "  riemhuman components standing/*.ply -o how_they_stand/ --pose --align --json\n",
    FILES,
    output("FOLDER", text="folder to write", is_ours=_IS_OF_COMPONENTS),
    option("-n --n-components", "components", default=3, metavar="K"),
    option("--samples", "number of random bodies", default=0, metavar="N"),
    option("--seed", "seed of the random bodies", default=0, metavar="S"),
    template("the first mesh"),
    ALIGN,
    metric_options(_COMPONENTS_METRIC),
)
def _components(options: argparse.Namespace) -> Answer:
    from riemhuman.checks import whole_number
    from riemhuman.io.outputs import atomic_folder

    if options.metric == "shape":
        raise ArgumentError(
            "the λ of --shape is too small for logarithms between people; leave out --shape: the "
            "default, -a 1 -l 1 -c 0, also describes body shape"
        )
    count = whole_number(options.n_components, "-n", minimum=1)
    whole_number(options.samples, "--samples", minimum=0)
    whole_number(options.seed, "--seed", minimum=0)
    with options.task("Reading the meshes"):
        surfaces = read_surfaces(options, options.meshes)
        n = len(surfaces)
        if n <= count:
            raise ArgumentError(f"-n {count} needs at least {count + 1} meshes; found {n}")
        points = surfaces[:]
    metric = chosen_metric(options, surfaces.template)
    metric.space.metric = metric
    with options.task(f"Components of {n}, {metric_name(metric)}"):
        nearest = rh.statistics.NearestSurface(progress=options.bars)
        pca = rh.statistics.TangentPCA(metric.space, count, nearest=nearest).fit(points)
    pca.nearest = None  # one progress bar over all bodies replaces one per body
    with options.task(f"{1 + 2 * count + options.samples} bodies"):
        bodies = _bodies_of_components(pca, options)
    record = {
        "files": surfaces.files,
        "metric": metric_record(metric),
        "n_components": pca.n_components_,
        "explained_variance": pca.explained_variance_,
        "explained_variance_ratio": pca.explained_variance_ratio_,
        "deviations": _DEVIATIONS,
        "coordinates": pca.transform(points),
        "samples": options.samples,
        "seed": options.seed,
    }
    faces = surfaces.faces
    names = [name.replace("_", " ") for name in bodies]
    title = "Mean, components and samples"
    with atomic_folder(options.output, _IS_OF_COMPONENTS) as folder:
        for name, surface in bodies.items():
            rh.save_mesh(folder / f"{name}.ply", surface, faces)
        page = folder / _COMPONENTS_PAGE
        rh.plots.save_picture(page, list(bodies.values()), faces, names, title=title)
        (folder / _SUMMARY).write_text(as_json(record) + "\n", encoding="utf-8")
    said = [
        f"component {k + 1}  {100 * share:.1f} % of the variance"
        for k, share in enumerate(pca.explained_variance_ratio_)
    ]
    return Answer("\n".join(said), record)


def _bodies_of_components(pca: Any, options: argparse.Namespace) -> dict[str, ndarray]:
    """Return the surfaces to write by name: the mean, the ends of components, and samples."""
    import numpy as np

    from riemhuman.progress import ProgressBar

    deviations = np.sqrt(pca.explained_variance_)
    names = [f"component_{k + 1}_{side}" for k in range(len(deviations)) for side in _SIDES]
    ends = [times * row for row in np.diag(deviations) for times in _SIDES.values()]
    bodies = {"mean": pca.mean_}
    with ProgressBar(ends, disable=not options.bars, unit="body") as bar:
        for name, end in zip(names, bar, strict=True):
            (bodies[name],) = pca.inverse_transform(end[None])
    if options.samples:
        samples = pca.sample(options.samples, options.seed)
        for k, surface in enumerate(samples.reshape(options.samples, *pca.mean_.shape)):
            bodies[f"sample_{k:04d}"] = surface
    return bodies
