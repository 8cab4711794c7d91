"""Compute how much of its surroundings each vertex of the open body model sees at rest.

Writes riemhuman/plots/web/occlusion.npz: `python tutorials/remake/build_occlusion.py`, some
seconds a model. Pages and pictures darken the folds of bodies by it.
"""

from pathlib import Path

import numpy as np

import riemhuman as rh
from riemhuman.plots._occlusion import open_shares, topology_name

FILE = Path(rh.plots.__file__).parent / "web" / "occlusion.npz"


def main() -> None:
    """Write the file."""
    arrays = {}
    for resolution in ("coarse", "full"):
        model = rh.datasets.load_open_model(resolution)
        shares = open_shares(model.template.vertices, model.faces)
        arrays[topology_name(model.faces)] = np.round(255 * shares).astype(np.uint8)
    rh.io.save_arrays(FILE, arrays, compressed=True)


if __name__ == "__main__":
    main()
