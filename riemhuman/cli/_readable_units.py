"""The option for the units of what people read; CSV files and JSON keep SI units."""

from __future__ import annotations

from riemhuman.cli import _commands as cli

UNITS = cli.choice(
    "--units",
    "units of what is printed and shown: centimetres, litres and kilograms, or inches and pounds; "
    "CSV and JSON keep metres and kilograms",
    "cm",
    "in",
)
