"""The options that choose a metric."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from riemhuman.errors import ArgumentError
from riemhuman.extensions import extension

if TYPE_CHECKING:
    from riemhuman.geometry import RiemannianMetric
    from riemhuman.surfaces.template import Template

# Triples of a, λ and c.
_PRESETS = {"shape": (1.0, 1e-4, 0.0), "pose": (0.0, 0.0, 1.0)}
PATH_METRIC = (1.0, 1.0, 0.1)  # limbs would shrink along paths of the shape metric


def add_metric_options(
    parser: argparse.ArgumentParser, default: tuple[float, float, float] = _PRESETS["shape"]
) -> None:
    """Declare the options that choose a metric.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the verb.
    default : tuple of float
        Default weights (a, λ, c).
    """
    a, lam, c = default
    name = "--shape" if default == _PRESETS["shape"] else f"-a {a:g} -l {lam:g} -c {c:g}"
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
    group.add_argument(
        "-a", type=float, metavar="A", help=f"weight of the metric part (default: {a:g})"
    )
    group.add_argument(
        "-l",
        "--lam",
        type=float,
        metavar="LAMBDA",
        help=f"weight λ of area within the metric part (default: {lam:g})",
    )
    group.add_argument(
        "-c", type=float, metavar="C", help=f"weight of the normal part (default: {c:g})"
    )
    parser.set_defaults(default_metric=default)


def add_align(parser: argparse.ArgumentParser) -> None:
    """Declare the option that removes rigid motions.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the verb.
    """
    parser.add_argument(
        "--align",
        action="store_true",
        help="first remove rigid motions, by Procrustes alignment with the template",
    )


def check_metric_options(options: argparse.Namespace) -> None:
    """Refuse contradictory options before any file is read.

    Parameters
    ----------
    options : argparse.Namespace
        Parsed options.

    Raises
    ------
    ArgumentError
        If a preset is combined with weights, or no package has the named metric.
    """
    own = [name for name in ("a", "lam", "c") if getattr(options, name) is not None]
    preset = options.metric or (options.extension and f"metric {options.extension}")
    if preset and own:
        raise ArgumentError(
            f"--{preset} sets all weights; leave it out, or leave out "
            f"{', '.join('-l' if name == 'lam' else f'-{name}' for name in own)}"
        )
    if options.extension:
        extension("metrics", options.extension)


def chosen_metric(options: argparse.Namespace, template: Template) -> Any:
    """Return the metric that the options ask for.

    Parameters
    ----------
    options : argparse.Namespace
        Parsed options.
    template : Template
        The template.

    Returns
    -------
    RiemannianMetric

    Raises
    ------
    ArgumentError
        If the options contradict each other, or the weights do not define a metric.
    """
    from riemhuman.geometry import AlignedSurfaces, ElasticMetric, SRNFMetric

    check_metric_options(options)
    # Surfaces share a unit: this is checked when they are read.
    space = AlignedSurfaces(template, equip=False, scale=None)
    if options.extension:
        return extension("metrics", options.extension)(space)
    if options.metric == "srnf":
        return SRNFMetric(space)
    a, lam, c = _PRESETS.get(options.metric, options.default_metric)
    given = (options.a, options.lam, options.c)
    weights = [
        own if own is not None else usual for own, usual in zip(given, (a, lam, c), strict=True)
    ]
    return ElasticMetric(space, a=weights[0], lam=weights[1], c=weights[2])


def metric_record(metric: RiemannianMetric) -> dict[str, Any]:
    """Return the name and the weights of a metric, for JSON.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric.

    Returns
    -------
    dict
        The name, and the weights of a metric of the paper's family.
    """
    from riemhuman.geometry import ElasticMetric, SRNFMetric

    if type(metric) is ElasticMetric:
        return {"name": "elastic", "a": metric.a, "lam": metric.lam, "c": metric.c}
    return {"name": "SRNF" if type(metric) is SRNFMetric else type(metric).__name__}


def metric_name(metric: RiemannianMetric) -> str:
    """Return the name of a metric, for messages.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric.

    Returns
    -------
    str
    """
    record = metric_record(metric)
    if record["name"] != "elastic":
        return str(record["name"])
    return f"(a, λ, c) = ({record['a']:g}, {record['lam']:g}, {record['c']:g})"
