"""The option for the units of tables on the terminal; files and JSON keep SI units."""

from __future__ import annotations

from riemhuman.cli import _commands as cli

SHORT_UNITS = {"metres": "m", "centimetres": "cm", "millimetres": "mm", "inches": "in"}

UNITS = cli.choice(
    "--units",
    "units of the printed table: centimetres, litres and kilograms, or inches and pounds; CSV and "
    "JSON keep metres and kilograms",
    "cm",
    "in",
)
