"""TRC files of markers, as OpenSim writes them, and C3D files."""

import struct

import numpy as np
import pytest

RATE = 20.0
CENTRES = {"hip": "HJC", "knee": "KJC", "ankle": "AJC", "shoulder": "SJC", "elbow": "EJC"}
CENTRES |= {"wrist": "WJC", "toes": "TOE"}


def centres(joints):
    """Return the centres of joints on both sides as markers, as LHJC for the left hip."""
    return {
        f"{side[0].upper()}{centre}": joints[f"{side}_{part}"]
        for side in ("left", "right")
        for part, centre in CENTRES.items()
    }


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


def c3d_bytes(
    points,
    labels,
    processor=84,
    scale=-1.0,
    n_analog=0,
    first=1,
    last=None,
    extra=None,
    groups_last=False,
):
    """Return a C3D file in the layout of a processor, of whole numbers if `scale` is positive.

    Points (n_frames, M, 3) are in millimetres, NaN where unseen; `extra` has parameters by
    "GROUP:NAME".
    """
    order = ">" if processor == 86 else "<"
    n_frames, n_points = points.shape[:2]

    def real(values):
        if processor != 85:
            return np.asarray(values, order + "f4").tobytes()
        halves = (4.0 * np.asarray(values, "<f4")).astype("<f4").view("<u2").reshape(-1, 2)
        return halves[:, ::-1].tobytes()

    parameters = {
        "POINT:USED": np.int16(n_points),
        "POINT:SCALE": np.float32(scale),
        "POINT:RATE": np.float32(RATE),
        "POINT:DATA_START": np.int16(0),
        "POINT:UNITS": np.array([["mm"]], "S2"),
        **(extra or {}),
    }
    if labels:
        width = max(map(len, labels))
        parameters["POINT:LABELS"] = np.array([[name.ljust(width)] for name in labels], f"S{width}")
    names = sorted({key.split(":")[0] for key in parameters})

    def record(name, number, body):
        stored = struct.pack("bb", len(name), number) + name.encode()
        return stored + struct.pack(order + "H", len(body) + 2) + body

    groups = [record(name, -number, b"\0") for number, name in enumerate(names, 1)]

    def sections(data_start):
        stored = []
        for key, value in (parameters | {"POINT:DATA_START": np.int16(data_start)}).items():
            group, name = key.split(":")
            value = np.asarray(value)
            if value.dtype.kind == "S":
                kind, sizes, data = -1, (value.dtype.itemsize, value.size), value.tobytes()
            elif value.dtype.kind == "f":
                kind, sizes, data = 4, value.shape[::-1], real(value.ravel())
            else:
                kind, sizes = 2, value.shape[::-1]
                data = value.astype(f"{order}i2").tobytes()
            body = struct.pack("bB", kind, len(sizes)) + bytes(sizes) + data + b"\0"
            stored.append(record(name, names.index(group) + 1, body))
        everything = [*stored, *groups] if groups_last else [*groups, *stored]
        return b"".join(everything) + b"\0\0"

    n_blocks = -(-(len(sections(0)) + 4) // 512)
    section = struct.pack("BBBB", 1, 0x50, n_blocks, processor) + sections(2 + n_blocks)
    unseen = np.isnan(points[..., :1])
    quadruples = np.where(unseen, 0.0, points) / abs(scale)
    quadruples = np.concatenate([quadruples, np.where(unseen, -1.0, 0.0)], axis=-1)
    rows = np.concatenate([quadruples.reshape(n_frames, -1), np.ones((n_frames, n_analog))], axis=1)
    data = real(rows.ravel()) if scale < 0 else rows.astype(f"{order}i2").tobytes()
    last = n_frames + first - 1 if last is None else last
    header = struct.pack("BB", 2, 0x50)
    header += struct.pack(f"{order}HHHHH", n_points, n_analog, first, last, 10) + real([scale])
    header += struct.pack(f"{order}HH", 2 + n_blocks, 1) + real([RATE])
    return header.ljust(512, b"\0") + section.ljust(512 * n_blocks, b"\0") + data
