"""Find the sockets of the open body model at rest, into which pictures set eyeballs.

Writes riemhuman/plots/web/eyes.npz: `python tutorials/remake/build_eyes.py`, a second.
"""

from pathlib import Path

import numpy as np

import riemhuman as rh
from riemhuman.plots._looks import topology_name

FILE = Path(rh.plots.__file__).parent / "web" / "eyes.npz"
# The sphere that the socket on the person's left is nearly, metres; the other is its mirror image.
CENTRE, RADIUS = np.array([0.0315, 1.5785, 0.1059]), 0.0163
NEAR = 0.003  # of the vertices of a socket from that sphere
IN_FRONT = 0.008  # of the centre, where the lids begin
N_CHOSEN = 12  # vertices of a socket
INSIDE = 0.97  # of the radius of the socket, which keeps eyeballs behind the lids


def main() -> None:
    """Write the file."""
    arrays = {}
    for resolution in ("coarse", "full"):
        model = rh.datasets.load_open_model(resolution)
        rest, name = model.template.vertices, topology_name(model.faces)
        sockets = [socket(rest, CENTRE * [side, 1.0, 1.0]) for side in (1, -1)]
        arrays[f"sockets_{name}"] = np.array(sockets, dtype=np.int32)
        arrays[f"weights_{name}"] = np.array(
            [weights(rest[chosen]) for chosen in sockets], dtype=np.float32
        )
    rh.io.save_arrays(FILE, arrays, compressed=True)


def socket(rest: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Return vertices of a socket that are far from each other."""
    gaps = np.abs(np.linalg.norm(rest - centre, axis=1) - RADIUS)
    inside = np.flatnonzero((gaps < NEAR) & (rest[:, 2] < centre[2] + IN_FRONT))
    chosen = [inside[np.argmin(rest[inside, 2])]]
    while len(chosen) < N_CHOSEN:
        apart = np.linalg.norm(rest[inside, None] - rest[chosen], axis=2).min(axis=1)
        chosen.append(inside[np.argmax(apart)])
    return np.array(chosen)


def weights(places: np.ndarray) -> np.ndarray:
    """Return the weights of vertices that give centre and half axes of the eye, shape (4, n).

    They are those of the affine map that moves the vertices at rest to where they are, by least
    squares.
    """
    squares = np.linalg.lstsq(
        np.column_stack([2 * places, np.ones(len(places))]), (places**2).sum(axis=1), rcond=None
    )[0]
    centre = squares[:3]
    radius = np.sqrt(squares[3] + centre @ centre)
    frame = np.eye(4)[[3, 0, 1, 2]] * INSIDE * radius
    frame[0] = [*centre, 1.0]
    return frame @ np.linalg.pinv(np.column_stack([places, np.ones(len(places))]))


if __name__ == "__main__":
    main()
