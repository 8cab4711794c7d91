"""TRC files of markers, as OpenSim writes them, and C3D files."""

import numpy as np
import pytest

RATE = 20.0


def write_trc(path, markers, unit="mm", missing="", tabs=True, header=None):
    """Write a TRC file; NaN is written as `missing`, and `header` replaces values."""
    names, n_frames = list(markers), len(next(iter(markers.values())))
    values = {"DataRate": RATE, "CameraRate": RATE, "NumFrames": n_frames}
    values |= {"NumMarkers": len(names), "Units": unit, "OrigDataRate": RATE} | (header or {})
    scale = {"mm": 1000.0, "cm": 100.0}.get(unit, 1.0)
    separator = "\t" if tabs else " "
    lines = [f"PathFileType\t4\t(X/Y/Z)\t{path.name}", "\t".join(values)]
    lines.append("\t".join(map(str, values.values())))
    lines.append(separator.join(["Frame#", "Time", *(name + 2 * "\t" * tabs for name in names)]))
    axes = [f"{axis}{number}" for number in range(1, len(names) + 1) for axis in "XYZ"]
    lines += ["\t\t" + "\t".join(axes), ""]
    rows = scale * np.stack(list(markers.values()), axis=1).reshape(n_frames, -1)
    for number, row in enumerate(rows):
        cells = [missing if np.isnan(value) else f"{value:.5f}" for value in row]
        lines.append(separator.join([str(number + 1), f"{number / RATE:.5f}", *cells]))
    path.write_text("\n".join(lines) + "\n")
    return path


def write_c3d(path, markers, unit="mm"):
    """Write a C3D file; skip the test where ezc3d is not installed."""
    ezc3d = pytest.importorskip("ezc3d")
    content = ezc3d.c3d()
    names = list(markers)
    points = 1000.0 * np.stack(list(markers.values()), axis=1)
    content["parameters"]["POINT"]["RATE"]["value"] = [RATE]
    content["parameters"]["POINT"]["LABELS"]["value"] = names
    content["parameters"]["POINT"]["UNITS"]["value"] = [unit]
    content["data"]["points"] = np.concatenate(
        [np.moveaxis(points, -1, 0).swapaxes(1, 2), np.ones((1, len(names), len(points)))]
    )
    content.write(str(path))
    return path
