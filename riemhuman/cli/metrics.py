"""The options that choose a metric, common to the verbs that measure."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from riemhuman.errors import ArgumentError
from riemhuman.extensions import extension

if TYPE_CHECKING:
    from riemhuman.geometry.metric import RiemannianMetric
    from riemhuman.surfaces.template import Template

# Triples of a, λ and c.
_PRESETS = {"shape": (1.0, 1e-4, 0.0), "pose": (0.0, 0.0, 1.0)}
PATH_METRIC = (1.0, 1.0, 0.1)  # where the shape metric would let limbs melt on their way


def add_metric_options(
    parser: argparse.ArgumentParser, default: tuple[float, float, float] = _PRESETS["shape"]
) -> None:
    """Declare the options that choose a metric.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the verb.
    default : tuple of float
        (a, λ, c) without any option.
    """
    a, lam, c = default
    name = "--shape" if default == _PRESETS["shape"] else f"-a {a:g} -l {lam:g} -c {c:g}"
    group = parser.add_argument_group(
        "metric",
        f"a · Ebin(λ) + c · normals; by default {name}; -a, -l and -c change one weight each",
    )
    presets = group.add_mutually_exclusive_group()
    presets.add_argument(
        "--shape",
        dest="metric",
        action="store_const",
        const="shape",
        help="tells who it is: (a, λ, c) = (1, 0.0001, 0)",
    )
    presets.add_argument(
        "--pose",
        dest="metric",
        action="store_const",
        const="pose",
        help="tells how they stand: (a, λ, c) = (0, 0, 1)",
    )
    presets.add_argument(
        "--srnf",
        dest="metric",
        action="store_const",
        const="srnf",
        help="square root normal fields, to compare with",
    )
    presets.add_argument(
        "--metric",
        dest="extension",
        metavar="NAME",
        help="a metric that another package registers, see riemhuman.extensions",
    )
    group.add_argument(
        "-a", type=float, metavar="A", help=f"weight of the change of metric ({a:g})"
    )
    group.add_argument(
        "-l",
        "--lam",
        type=float,
        metavar="LAMBDA",
        help=f"λ, weight of the change of area within it ({lam:g})",
    )
    group.add_argument(
        "-c", type=float, metavar="C", help=f"weight of the change of normals ({c:g})"
    )
    parser.set_defaults(default_metric=default)


def add_align(parser: argparse.ArgumentParser) -> None:
    """Declare the options on how surfaces are compared.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the verb.
    """
    parser.add_argument(
        "--align",
        action="store_true",
        help="remove rigid motions first, by Procrustes alignment with the template",
    )


def check_metric_options(options: argparse.Namespace) -> None:
    """Refuse options that contradict each other, before any file is read.

    Parameters
    ----------
    options : argparse.Namespace
        Parsed options.

    Raises
    ------
    ArgumentError
        If a preset and weights of its own are asked for, or a metric that nobody made known.
    """
    own = [name for name in ("a", "lam", "c") if getattr(options, name) is not None]
    preset = options.metric or (options.extension and f"metric {options.extension}")
    if preset and own:
        raise ArgumentError(
            f"--{preset} sets all weights; leave it out, or "
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
        If the options contradict each other or make no metric.
    """
    from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
    from riemhuman.geometry.elastic_metric import ElasticMetric
    from riemhuman.geometry.srnf import SRNFMetric

    check_metric_options(options)
    # Whoever read the surfaces has seen to it that they share a unit.
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
    """Return what a metric is, for JSON.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric.

    Returns
    -------
    dict
        Its name, and its weights where it has any.
    """
    from riemhuman.geometry.elastic_metric import ElasticMetric
    from riemhuman.geometry.srnf import SRNFMetric

    if type(metric) is ElasticMetric:
        return {"name": "elastic", "a": metric.a, "lam": metric.lam, "c": metric.c}
    return {"name": "SRNF" if type(metric) is SRNFMetric else type(metric).__name__}


def metric_name(metric: RiemannianMetric) -> str:
    """Return what a metric is, for people.

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
