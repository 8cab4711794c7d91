"""The option for the units of what people read; CSV files and JSON keep SI units."""

from __future__ import annotations

import argparse

from riemhuman.cli import _commands as cli

_SYSTEMS = ("cm", "in")


def _earlier_spelling(parser: argparse._ActionsContainer) -> None:
    parser.add_argument(
        "--units",
        dest="output_units",
        choices=_SYSTEMS,
        default=argparse.SUPPRESS,
        help=argparse.SUPPRESS,
    )


OUTPUT_UNITS = cli.several(
    cli.choice(
        "--output-units",
        "units of what is printed and shown: centimetres, litres and kilograms, or inches and "
        "pounds; CSV and JSON keep metres and kilograms",
        *_SYSTEMS,
    ),
    _earlier_spelling,
)
