"""The verb ``mean``: the Karcher mean of bodies."""

from __future__ import annotations

import argparse

from riemhuman.cli.bases import add_basis_options, chosen_basis
from riemhuman.cli.inputs import add_template, meshes_named, path_argument, surfaces_in
from riemhuman.cli.metrics import (
    PATH_METRIC,
    add_align,
    add_metric_options,
    check_metric_options,
    chosen_metric,
    metric_name,
    metric_record,
)
from riemhuman.cli.pictures import add_picture, check_picture, write_picture
from riemhuman.cli.terminal import Reporter, convergence, say, say_json
from riemhuman.cli.verbs import Verbs, add_json, add_output, add_verb
from riemhuman.io.outputs import check_output_file


def add_verbs(verbs: Verbs) -> None:
    """Declare ``mean``.

    Parameters
    ----------
    verbs : argparse action
        The parser's verbs.
    """
    parser = add_verb(
        verbs,
        "mean",
        _mean,
        "the Karcher mean of registered meshes",
        "Writes the body with the least mean squared distance from the meshes, searched over a\n"
        "basis of deformations and the differences of the meshes.",
        "  riemhuman mean anna.ply ben.ply carl.ply -o mean.ply --align\n"
        "  riemhuman mean scans/ -o mean.obj --pose\n"
        "  riemhuman mean scans/ -o mean.ply --basis basis.npz -a 1 -l 1 -c 0.1 --json\n",
    )
    parser.add_argument(
        "meshes", metavar="FILES", nargs="+", type=path_argument, help="mesh files, or folders"
    )
    add_output(parser, "MESH")
    add_basis_options(parser)
    add_template(parser, "the first mesh")
    add_align(parser)
    add_metric_options(parser, PATH_METRIC)
    add_picture(parser)
    add_json(parser)


def _mean(options: argparse.Namespace) -> None:
    from riemhuman.io.meshes import save_mesh
    from riemhuman.protocols import uninterrupted
    from riemhuman.solvers import BasisMean

    check_metric_options(options)
    check_output_file(options.output, [".ply", ".obj", ".off"], force=options.force)
    check_picture(options)
    reporter = Reporter(options.quiet)
    files = meshes_named(options.meshes)
    with reporter.task(f"Reading {len(files)} meshes"):
        surfaces = surfaces_in(files, options)
        points = surfaces[:]
    metric = chosen_metric(options, surfaces.template)
    basis = chosen_basis(options, surfaces.template, reporter)
    with reporter.task(f"Mean of {len(files)}, {metric_name(metric)}"):
        result = BasisMean(basis, progress=reporter.bars).solve(metric, points)
    uninterrupted(result)
    save_mesh(options.output, result.point, surfaces.template.faces)
    shown = [*points, result.point]
    titles = [*(file.stem for file in files), "Karcher mean"]
    title = "Meshes and their mean"
    write_picture(options.picture, shown, surfaces.template.faces, titles, title)

    if options.json:
        say_json(
            {
                "files": files,
                "metric": metric_record(metric),
                "variance": result.variance,
                "variances": result.variances,
                "n_iterations": result.n_iterations,
                "converged": result.converged,
                "message": result.message,
                "output": options.output,
            }
        )
        return
    say(f"variance    {result.variance:.8g}  (mean squared distance)")
    say(f"converged   {convergence(result)}")
    say(f"written to  {options.output}")
