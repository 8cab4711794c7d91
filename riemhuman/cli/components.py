"""The verb ``components``: principal components of bodies, and new bodies."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from riemhuman.cli.inputs import add_template, meshes_named, path_argument, surfaces_in
from riemhuman.cli.metrics import (
    add_align,
    add_metric_options,
    check_metric_options,
    chosen_metric,
    metric_name,
    metric_record,
)
from riemhuman.cli.pictures import write_picture
from riemhuman.cli.terminal import Reporter, as_json, say, say_json
from riemhuman.cli.verbs import Verbs, add_json, add_output, add_verb
from riemhuman.errors import ArgumentError
from riemhuman.io.outputs import atomic_folder, check_output_folder

if TYPE_CHECKING:
    from numpy import ndarray

    from riemhuman.statistics import TangentPCA

_SUMMARY = "summary.json"
_PAGE = "components.html"
_BUILD = (1.0, 1.0, 0.0)  # with a much smaller λ, triangles have no logarithm
_DEVIATIONS = 2.0
_SIDES = {"minus": -_DEVIATIONS, "plus": _DEVIATIONS}


def add_verbs(verbs: Verbs) -> None:
    """Declare ``components``.

    Parameters
    ----------
    verbs : argparse action
        The parser's verbs.
    """
    parser = add_verb(
        verbs,
        "components",
        _components,
        "principal components of registered meshes, and new bodies",
        "Finds the directions in which meshes differ most, by principal component analysis of\n"
        "their logarithms at the Karcher mean. Writes a folder with the mean (mean.ply), the\n"
        "bodies two standard deviations from it along each component (component_1_minus.ply,\n"
        "component_1_plus.ply, ...), random bodies (sample_0000.ply, ...), a page that shows\n"
        "them (components.html), and summary.json.",
        "  riemhuman components scans/ -o components/\n"
        "  riemhuman components scans/ -o components/ -n 5 --samples 20 --seed 7\n"
        "  riemhuman components standing/*.ply -o how_they_stand/ --pose --align --json\n",
    )
    parser.add_argument(
        "meshes", metavar="FILES", nargs="+", type=path_argument, help="mesh files, or folders"
    )
    add_output(parser, "FOLDER", "folder to write")
    parser.add_argument(
        "-n",
        "--n-components",
        type=int,
        default=3,
        metavar="K",
        help="components (default: 3)",
    )
    parser.add_argument(
        "--samples", type=int, default=0, metavar="N", help="number of random bodies (default: 0)"
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="S", help="seed of the random bodies (default: 0)"
    )
    add_template(parser, "the first mesh")
    add_align(parser)
    add_metric_options(parser, _BUILD)
    add_json(parser)


def _components(options: argparse.Namespace) -> None:
    from riemhuman.checks import whole_number
    from riemhuman.statistics import NearestSurface, TangentPCA

    check_metric_options(options)
    if options.metric == "shape":
        raise ArgumentError(
            "the λ of --shape is too small for logarithms between people; leave out --shape: the "
            "default, -a 1 -l 1 -c 0, also describes body shape"
        )
    count = whole_number(options.n_components, "-n", minimum=1)
    n_samples = whole_number(options.samples, "--samples", minimum=0)
    whole_number(options.seed, "--seed", minimum=0)
    check_output_folder(options.output, _is_ours, force=options.force)
    reporter = Reporter(options.quiet)
    files = meshes_named(options.meshes)
    with reporter.task(f"Reading {len(files)} meshes"):
        surfaces = surfaces_in(files, options)
        if len(files) <= count:
            raise ArgumentError(f"-n {count} needs at least {count + 1} meshes; found {len(files)}")
        points = surfaces[:]
    metric = chosen_metric(options, surfaces.template)
    space = metric.space
    space.metric = metric
    with reporter.task(f"Components of {len(files)}, {metric_name(metric)}"):
        nearest = NearestSurface(progress=reporter.bars)
        pca = TangentPCA(space, count, nearest=nearest).fit(points)
    pca.nearest = None  # one progress bar over all bodies replaces one per body
    with reporter.task(f"{1 + 2 * count + n_samples} bodies"):
        bodies = _bodies(pca, n_samples, options.seed, bars=reporter.bars)

    record = _record(options, files, metric_record(metric), pca, points)
    with atomic_folder(options.output, _is_ours) as folder:
        _fill(folder, bodies, surfaces.template.faces, record)
    if options.json:
        say_json(record | {"output": options.output})
        return
    for k, share in enumerate(pca.explained_variance_ratio_):
        say(f"component {k + 1}  {100 * share:.1f} % of the variance")
    say(f"written to   {options.output}")


def _bodies(
    pca: TangentPCA, n_samples: int, seed: int, *, bars: bool = False
) -> dict[str, ndarray]:
    """Return the surfaces to write, by the names of their files."""
    import numpy as np

    from riemhuman.progress import ProgressBar

    deviations = np.sqrt(pca.explained_variance_)
    names = ["mean.ply"]
    names += [f"component_{k + 1}_{side}.ply" for k in range(len(deviations)) for side in _SIDES]
    ends = [times * row for row in np.diag(deviations) for times in _SIDES.values()]
    surfaces = [pca.mean_]
    for end in ProgressBar(ends, disable=not bars, unit="body"):
        surfaces += [*pca.inverse_transform(end[None])]
    if n_samples:
        names += [f"sample_{k:04d}.ply" for k in range(n_samples)]
        surfaces += [*pca.sample(n_samples, seed).reshape(n_samples, *pca.mean_.shape)]
    return dict(zip(names, surfaces, strict=True))


def _record(
    options: argparse.Namespace,
    files: list[Path],
    metric: dict[str, Any],
    pca: TangentPCA,
    points: ndarray,
) -> dict[str, Any]:
    return {
        "files": files,
        "metric": metric,
        "n_components": pca.n_components_,
        "explained_variance": pca.explained_variance_,
        "explained_variance_ratio": pca.explained_variance_ratio_,
        "deviations": _DEVIATIONS,
        "coordinates": pca.transform(points),
        "samples": options.samples,
        "seed": options.seed,
    }


def _fill(folder: Path, bodies: dict[str, ndarray], faces: ndarray, record: dict[str, Any]) -> None:
    from riemhuman.io.meshes import save_mesh

    for name, surface in bodies.items():
        save_mesh(folder / name, surface, faces)
    names = [Path(name).stem.replace("_", " ") for name in bodies]
    write_picture(
        folder / _PAGE, list(bodies.values()), faces, names, "Mean, components and samples"
    )
    (folder / _SUMMARY).write_text(as_json(record) + "\n", encoding="utf-8")


def _is_ours(name: str) -> bool:
    ours = r"mean\.ply|component_\d+_(minus|plus)\.ply|sample_\d{4,}\.ply"
    return bool(re.fullmatch(ours, name)) or name in (_SUMMARY, _PAGE)
