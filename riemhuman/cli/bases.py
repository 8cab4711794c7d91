"""The verb ``basis``, and the options by which other verbs choose a basis of deformations."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from riemhuman.cli.inputs import add_units, path_argument
from riemhuman.cli.terminal import Reporter, say, say_json
from riemhuman.cli.verbs import Verbs, add_json, add_output, add_verb
from riemhuman.errors import ArgumentError
from riemhuman.io.outputs import check_output_file

if TYPE_CHECKING:
    from riemhuman.datasets import Motion
    from riemhuman.surfaces.deformation_basis import DeformationBasis
    from riemhuman.surfaces.template import Template

_N_HARMONICS = 60


def add_verbs(verbs: Verbs) -> None:
    """Declare ``basis``.

    Parameters
    ----------
    verbs : argparse action
        The parser's verbs.
    """
    parser = add_verb(
        verbs,
        "basis",
        _basis,
        "a basis of deformations from motions",
        "Writes the principal components of the deformations in motions, for geodesics and\n"
        "means. Motions are files of Dynamic FAUST (.hdf5), folders of registered meshes that\n"
        "show one motion in the order of their names, or folders of such folders. They need\n"
        "not fit into memory.",
        "  riemhuman basis registrations_m.hdf5 registrations_f.hdf5 -o basis.npz\n"
        "  riemhuman basis registrations_m.hdf5 --sequences punching knees -o basis.npz\n"
        "  riemhuman basis walk/ jump/ -o basis.npz --step 5 --n-components 40\n"
        "  riemhuman basis --open --resolution coarse -o basis.npz\n",
    )
    parser.add_argument(
        "motions", metavar="MOTIONS", nargs="*", type=path_argument, help="HDF5 files or folders"
    )
    parser.add_argument(
        "--open", action="store_true", help="use the open motions that ship with the package"
    )
    parser.add_argument(
        "--resolution",
        choices=("full", "coarse"),
        default="full",
        help="with --open: 13,348 or 1,202 vertices (default: full)",
    )
    parser.add_argument(
        "--subjects", nargs="+", metavar="NAME", help="with --open or HDF5: only these people"
    )
    parser.add_argument(
        "--sequences", nargs="+", metavar="NAME", help="with --open or HDF5: only these motions"
    )
    add_output(parser, "NPZ")
    parser.add_argument(
        "-n",
        "--n-components",
        type=int,
        default=100,
        metavar="K",
        help="components (default: 100)",
    )
    parser.add_argument(
        "--step",
        type=int,
        default=10,
        metavar="FRAMES",
        help="number of frames between the two surfaces of a deformation (default: 10)",
    )
    add_units(parser)
    add_json(parser)


def add_basis_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options that choose a basis of deformations.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the verb.
    """
    choice = parser.add_mutually_exclusive_group()
    choice.add_argument(
        "--basis",
        metavar="NPZ",
        type=path_argument,
        help="basis of deformations, see riemhuman basis (default: mesh harmonics)",
    )
    choice.add_argument(
        "--n-components",
        type=int,
        metavar="K",
        help=f"number of mesh harmonics, without --basis (default: {_N_HARMONICS})",
    )


def chosen_basis(
    options: argparse.Namespace, template: Template, reporter: Reporter
) -> DeformationBasis:
    """Return the basis that the options choose.

    Parameters
    ----------
    options : argparse.Namespace
        Parsed options.
    template : Template
        The template.
    reporter : Reporter
        Reports what the verb does.

    Returns
    -------
    DeformationBasis

    Raises
    ------
    ArgumentError
        If the basis does not fit the template.
    """
    from riemhuman.surfaces.deformation_basis import DeformationBasis

    if options.basis is None:
        count = _N_HARMONICS if options.n_components is None else options.n_components
        with reporter.task(f"{count} mesh harmonics"):
            return DeformationBasis.from_laplacian(template, count)
    basis = DeformationBasis.load(options.basis)
    try:
        basis.check_fits(template)
    except ArgumentError as error:
        raise ArgumentError(f"{options.basis}: {error}") from error
    return basis


def _basis(options: argparse.Namespace) -> None:
    from riemhuman.surfaces.deformation_basis import DeformationBasis

    check_output_file(options.output, [".npz"], force=options.force)
    reporter = Reporter(options.quiet)
    motions = _motions(options)
    n_frames = sum(len(motion) for motion in motions)
    with reporter.task(f"{len(motions)} motions, {n_frames:,} frames"):
        basis = DeformationBasis.from_motions(
            motions, options.n_components, options.step, progress=reporter.bars
        )
    basis.save(options.output)
    ratio = basis.explained_variance_ratio
    explained = None if ratio is None else float(ratio.sum())
    if options.json:
        say_json(
            {
                "output": options.output,
                "n_components": basis.n_components,
                "n_vertices": basis.n_vertices,
                "n_motions": len(motions),
                "n_frames": n_frames,
                "step": options.step,
                "explained_variance": explained,
            }
        )
        return
    say(f"{basis.n_components} deformations of {basis.n_vertices:,} vertices")
    if explained is not None:
        say(f"{100 * explained:.3f} % of the variance of the motions")
    say(f"written to {options.output}")


def _motions(options: argparse.Namespace) -> list[Motion]:
    """Return the chosen motions, whose frames are read when they are needed."""
    from riemhuman import datasets
    from riemhuman.datasets.motions import load_mesh_motions
    from riemhuman.io.mesh_arrays import face_difference

    if options.open == bool(options.motions):
        raise ArgumentError("give either HDF5 files or folders of motions, or --open")
    chosen = {"subjects": options.subjects, "sequences": options.sequences}
    if options.open:
        return list(datasets.load_open_motions(options.resolution, **chosen))
    motions: list[Motion] = []
    if (options.unit or options.up) and not any(map(Path.is_dir, options.motions)):
        raise ArgumentError("--unit and --up are for folders of meshes; HDF5 files are in metres")
    for path in options.motions:
        if path.is_dir() and not list(path.glob("*.hdf5")):
            if any(chosen.values()):
                raise ArgumentError(
                    f"--subjects and --sequences choose from HDF5 files; {path} is a folder of "
                    "meshes"
                )
            motions += load_mesh_motions(path, unit=options.unit, up=options.up)
        else:
            motions += datasets.load_dfaust(path, **chosen)
    for motion in motions[1:]:
        difference = face_difference(motion.faces, motions[0].faces)
        if difference:
            raise ArgumentError(
                f"all motions must share one triangulation; {motion.sequence} and "
                f"{motions[0].sequence} do not: {difference}"
            )
    return motions
