"""The options that choose a metric and a basis of deformations."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

import riemhuman as rh
from riemhuman.cli._commands import Argument, option, path_option, several
from riemhuman.errors import ArgumentError

if TYPE_CHECKING:
    from riemhuman.surfaces import DeformationBasis, Template

# Triples of a, λ and c.
_PRESETS = {"shape": (1.0, 1e-4, 0.0), "pose": (0.0, 0.0, 1.0)}
PATH_METRIC = (1.0, 1.0, 0.1)  # limbs would shrink along paths of the shape metric
_N_HARMONICS = 60


def metric_options(default: tuple[float, float, float] = _PRESETS["shape"]) -> Argument:
    """Return the declarations of the options that choose a metric."""
    a, lam, c = default
    name = "--shape" if default == _PRESETS["shape"] else f"-a {a:g} -l {lam:g} -c {c:g}"

    def declare(parser: argparse.ArgumentParser) -> None:
        group = parser.add_argument_group(
            "metric",
            f"a · Ebin(λ) + c · normals (default: {name}); -a, -l and -c change one weight each",
        )
        presets = group.add_mutually_exclusive_group()
        for preset, text in (
            ("shape", "compares people: (a, λ, c) = (1, 0.0001, 0)"),
            ("pose", "compares poses: (a, λ, c) = (0, 0, 1)"),
            ("srnf", "square root normal fields, for comparison"),
        ):
            presets.add_argument(
                f"--{preset}", dest="metric", action="store_const", const=preset, help=text
            )
        presets.add_argument(
            "--metric",
            dest="extension",
            metavar="NAME",
            help="metric of another package, see riemhuman.extensions",
        )
        for flags, metavar, text, weight in (
            (("-a",), "A", "weight of the metric part", a),
            (("-l", "--lam"), "LAMBDA", "weight λ of area within the metric part", lam),
            (("-c",), "C", "weight of the normal part", c),
        ):
            text = f"{text} (default: {weight:g})"
            group.add_argument(*flags, type=float, metavar=metavar, help=text)
        parser.set_defaults(default_metric=default)

    return declare


def check_metric(options: argparse.Namespace) -> None:
    """Raise an error before any file is read if a preset is combined with weights."""
    weights = [name for name in ("a", "lam", "c") if getattr(options, name) is not None]
    preset = options.metric or (options.extension and f"metric {options.extension}")
    if preset and weights:
        flags = ", ".join("-l" if name == "lam" else f"-{name}" for name in weights)
        raise ArgumentError(f"--{preset} sets all weights; leave it out, or leave out {flags}")
    if options.extension:
        rh.extensions.extension("metrics", options.extension)


def chosen_metric(options: argparse.Namespace, template: Template) -> Any:
    """Return the metric that the options ask for."""
    # Surfaces share a unit: this is checked when they are read.
    space = rh.AlignedSurfaces(template, equip=False, scale=None)
    if options.extension:
        return rh.extensions.extension("metrics", options.extension)(space)
    if options.metric == "srnf":
        return rh.SRNFMetric(space)
    default = _PRESETS.get(options.metric, options.default_metric)
    given = (options.a, options.lam, options.c)
    a, lam, c = (d if weight is None else weight for weight, d in zip(given, default, strict=True))
    return rh.ElasticMetric(space, a=a, lam=lam, c=c)


def metric_record(metric: Any) -> dict[str, Any]:
    """Return the name and the weights of a metric, for JSON."""
    if type(metric) is rh.ElasticMetric:
        return {"name": "elastic", "a": metric.a, "lam": metric.lam, "c": metric.c}
    return {"name": "SRNF" if type(metric) is rh.SRNFMetric else type(metric).__name__}


def metric_name(metric: Any) -> str:
    """Return the name of a metric, for messages."""
    record = metric_record(metric)
    if record["name"] != "elastic":
        return str(record["name"])
    return f"(a, λ, c) = ({record['a']:g}, {record['lam']:g}, {record['c']:g})"


BASIS = several(
    path_option(
        "--basis", "NPZ", "basis of deformations, see riemhuman basis (default: mesh harmonics)"
    ),
    option(
        "--n-components",
        f"number of mesh harmonics, without --basis (default: {_N_HARMONICS})",
        type=int,
        metavar="K",
    ),
    exclusive=True,
)


def chosen_basis(options: argparse.Namespace, template: Template) -> DeformationBasis:
    """Return the basis that the options choose; raise an error if it does not fit the template."""
    if options.basis is None:
        count = _N_HARMONICS if options.n_components is None else options.n_components
        with options.reporter.task(f"{count} mesh harmonics"):
            harmonics: DeformationBasis = rh.DeformationBasis.from_laplacian(template, count)
            return harmonics
    basis: DeformationBasis = rh.DeformationBasis.load(options.basis)
    try:
        basis.check_fits(template)
    except ArgumentError as error:
        raise ArgumentError(f"{options.basis}: {error}") from error
    return basis
