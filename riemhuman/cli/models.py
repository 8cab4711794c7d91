"""The verb ``convert-model``: plain arrays from pickles of SMPL."""

from __future__ import annotations

import argparse

from riemhuman.cli.inputs import path_argument
from riemhuman.cli.terminal import Reporter, say
from riemhuman.cli.verbs import Verbs, add_output, add_verb
from riemhuman.io.outputs import check_output_file


def add_verbs(verbs: Verbs) -> None:
    """Declare ``convert-model``.

    Parameters
    ----------
    verbs : argparse action
        The parser's verbs.
    """
    parser = add_verb(
        verbs,
        "convert-model",
        _convert,
        "plain arrays from a body model's pickle",
        "Writes a model of the SMPL family as an .npz file of plain arrays. A pickle is code: it\n"
        "is read as data and never run, and a call that is not known is refused by name.",
        "  riemhuman convert-model basicmodel_neutral_lbs_10_207_0_v1.0.0.pkl -o SMPL.npz\n"
        "  riemhuman convert-model smplh/female/model.npz -o SMPLH_female.npz --n-betas 16\n",
    )
    parser.add_argument("source", metavar="MODEL", type=path_argument, help=".pkl or .npz file")
    add_output(parser, "NPZ")
    parser.add_argument(
        "--n-betas",
        type=int,
        metavar="B",
        help="number of shape coefficients to keep (default: 10 of 300 or more, else all)",
    )


def _convert(options: argparse.Namespace) -> None:
    from riemhuman.bodies import convert_model, model_contents

    check_output_file(options.output, [".npz"], force=options.force)
    reporter = Reporter(options.quiet)
    with reporter.task("Converting"):
        model = convert_model(options.source, options.output, n_betas=options.n_betas)
    say(str(model_contents(options.source, options.n_betas)))
    say(
        f"{model.n_vertices:,} vertices, {model.n_joints} joints, {model.n_betas} shape "
        "coefficients"
    )
    say(f"written to {options.output}")
