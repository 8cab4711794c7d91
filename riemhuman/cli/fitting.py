"""The verb ``fit``: shape and pose of a body model for registered meshes."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from riemhuman.cli.inputs import add_units, meshes_named, path_argument, surfaces_in
from riemhuman.cli.pictures import add_picture, check_picture, write_picture
from riemhuman.cli.terminal import Reporter, say, say_json
from riemhuman.cli.verbs import Verbs, add_json, add_output, add_verb
from riemhuman.errors import ArgumentError
from riemhuman.io.outputs import check_output_file

if TYPE_CHECKING:
    from riemhuman.bodies import BodyModel


def add_verbs(verbs: Verbs) -> None:
    """Declare ``fit``.

    Parameters
    ----------
    verbs : argparse action
        The parser's verbs.
    """
    parser = add_verb(
        verbs,
        "fit",
        _fit,
        "shape and pose of a body model for registered meshes",
        "Fits the shape coefficients, pose and translation of a body model to meshes that share\n"
        "its triangulation, and writes the arrays betas, pose, trans, distances and names to an\n"
        ".npz file.",
        "  riemhuman fit scans/ -o fits.npz                       # the open model\n"
        "  riemhuman fit anna.ply ben.ply -o fits.npz --model SMPL.npz\n"
        "  riemhuman fit scans/ -o fits.npz --picture fits.html --json\n",
    )
    parser.add_argument(
        "meshes", metavar="FILES", nargs="+", type=path_argument, help="mesh files, or folders"
    )
    add_output(parser, "NPZ")
    parser.add_argument(
        "--model", metavar="FILE", type=path_argument, help="body model (default: the open one)"
    )
    parser.add_argument(
        "--any-scale",
        action="store_true",
        help="accept meshes of any size; by default, meshes in another unit are refused",
    )
    add_units(parser)
    add_picture(parser)
    add_json(parser)
    parser.set_defaults(template=None, align=False)


def _fit(options: argparse.Namespace) -> None:
    import numpy as np

    from riemhuman.io.arrays import save_arrays
    from riemhuman.progress import ProgressBar

    check_output_file(options.output, [".npz"], force=options.force)
    check_picture(options)
    reporter = Reporter(options.quiet)
    files = meshes_named(options.meshes)
    surfaces = surfaces_in(files, options)
    model = _model(options, surfaces.template.n_vertices)
    fits = []
    with reporter.task(f"Fit of {len(files)} meshes"):
        for index in ProgressBar(range(len(files)), disable=not reporter.bars, unit="mesh"):
            fits.append(model.fit(surfaces[index]))
    names = [file.name for file in files]
    found = {
        name: np.stack([getattr(fit, name) for fit in fits])
        for name in ("betas", "pose", "trans", "distances")
    }
    save_arrays(options.output, {**found, "names": np.array(names)})
    if options.picture is not None:
        shown = [
            surface
            for k, fit in enumerate(fits)
            for surface in (surfaces[k], model(fit.betas, fit.pose, fit.trans))
        ]
        titles = [title for file in files for title in (file.stem, f"{file.stem}, model")]
        write_picture(
            options.picture, shown, surfaces.template.faces, titles, "Meshes, each beside its model"
        )
    means = [1000.0 * float(fit.mean_distance) for fit in fits]
    converged = [bool(fit.converged) for fit in fits]
    if options.json:
        say_json(
            {
                "files": files,
                "mean_distance_mm": means,
                "converged": converged,
                "output": options.output,
            }
        )
        return
    for name, mean, done in zip(names, means, converged, strict=True):
        say(f"{mean:8.3f} mm  {name}{'' if done else '  (did not converge)'}")
    say(f"written to {options.output}; mean distances between mesh and model")


def _model(options: argparse.Namespace, n_vertices: int) -> BodyModel:
    from riemhuman.bodies import BodyModel
    from riemhuman.datasets import load_open_model

    if options.model is not None:
        return BodyModel.from_file(options.model)
    for resolution in ("coarse", "full"):
        model = load_open_model(resolution)
        if model.n_vertices == n_vertices:
            return model
    raise ArgumentError(
        f"the meshes have {n_vertices:,} vertices, but the open model has 1,202 or 13,348; give "
        "the model that they are registered to with --model FILE"
    )
