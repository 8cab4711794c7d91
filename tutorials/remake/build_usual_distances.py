"""Compute how far the open bodies usually are from each other; rebuild usual_distances.json.

    python tutorials/remake/build_usual_distances.py [file]

The distances, of one person in two poses and of two people in one pose, are what `riemhuman dist`
and `riemhuman compare` print for comparison.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from riemhuman.datasets import load_open_model
from riemhuman.measurements.measurement_set import DATA
from riemhuman.measurements.people import usual_distances_of, usual_metrics


def main(arguments: Sequence[str] | None = None) -> None:
    """Compute and write."""
    parser = argparse.ArgumentParser(description="Compute usual distances of the open bodies.")
    parser.add_argument("file", nargs="?", type=Path, default=DATA / "usual_distances.json")
    options = parser.parse_args(arguments)
    record = {}
    for name, metric in usual_metrics(load_open_model("coarse").template).items():
        usual = usual_distances_of(metric)
        record[name] = [round(usual.one_person, 6), round(usual.two_people, 6)]
        sys.stdout.write(f"{name:10} {metric}: {record[name]}\n")
    options.file.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
