"""TRC files of markers, as OpenSim writes them."""

import numpy as np

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
