"""The option for the units of tables on the terminal; files and JSON keep SI units."""

from __future__ import annotations

from riemhuman.cli import _commands as cli
from riemhuman.readable_units import READABLE_UNITS

UNITS = cli.choice(
    "--units",
    "units of the printed table: centimetres, litres and kilograms, or inches and pounds; CSV and "
    "JSON keep metres and kilograms",
    *READABLE_UNITS,
)
