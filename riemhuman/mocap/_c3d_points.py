"""Copies the points of a C3D file to an .npz file: a script, run in a process of its own.

ezc3d does not check where a damaged file points to: then this process may end, not the user's.
"""

import sys

import numpy as np


def copy_points(source: str, target: str) -> None:
    """Write the names, positions (n_frames, M, 3), rate and unit of the points of a file."""
    import ezc3d  # an optional dependency

    tree = ezc3d.c3d(source)
    points = tree["parameters"]["POINT"]
    positions = np.asarray(tree["data"]["points"], dtype=np.float64)[:3].transpose(2, 1, 0)
    # Names after the 255th are in LABELS2 and so on.
    names: list[str] = []
    key, number = "LABELS", 2
    while key in points:
        names += [str(name).strip() for name in points[key]["value"]]
        key, number = f"LABELS{number}", number + 1
    units = points["UNITS"]["value"] if "UNITS" in points else []
    np.savez(
        target,
        names=np.array(names, dtype=str),
        positions=np.ascontiguousarray(positions),
        rate=float(points["RATE"]["value"][0]),
        unit=np.array(str(units[0]) if len(units) else "", dtype=str),
    )


if __name__ == "__main__":
    copy_points(*sys.argv[1:])
