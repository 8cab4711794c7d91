"""What the library reads of a file, and what independent parsers read of it.

A reader returns arrays by name. Its judge, which shares no code with the library, returns those
that must be equal, or raises an error where the file is not to be accepted.
"""

import csv
import io
import re
import warnings

import numpy as np
from plyfile import PlyData
from trust import structured_array_judges as arrays
from trust.judging import expect, mesh, real, real_or_none, whole

from riemhuman.datasets import load_bodies
from riemhuman.datasets.shrec import read_classes
from riemhuman.descriptors.latent_vectors import LatentVectors
from riemhuman.io.arrays import load_array, load_arrays
from riemhuman.io.meshes import load_mesh


def read_mesh(file):
    return dict(zip(("vertices", "faces"), load_mesh(file), strict=True))


def judge_ply(file):
    content = file.read_bytes()
    end = re.match(rb"ply(\r\n|\n|\r)", content)[1]
    head, _, body = content.partition(end + b"end_header" + end)
    lines = head.split(end)
    # Comments in any encoding are legal, but not to plyfile.
    lines = [b"comment" if line.split()[:1] in ([b"comment"], [b"obj_info"]) else line
             for line in lines]  # fmt: skip
    if b"format ascii 1.0" in lines:
        # Zero is legal in whatever spelling, but not to plyfile.
        body = re.sub(rb"(?<![^ \t\r\n\v\f])-0+(?![^ \t\r\n\v\f])", b"0", body)
    stream = io.BytesIO(end.join([*lines, b"end_header", body]))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of empty lists
        found = PlyData.read(stream)
    if found.text:
        expect(b"_" not in body, "an underscore")
        rows = [row for row in re.split(rb"\r\n|\r|\n", body) if row.strip()]
        expect(len(rows) <= sum(len(each.data) for each in found.elements), "more lines")
    else:
        expect(stream.read() == b"", "more bytes")
    names = [each.name for each in found["face"].properties]
    corners = found["face"]["vertex_indices" if "vertex_indices" in names else "vertex_index"]
    return mesh(np.stack([found["vertex"][axis] for axis in "xyz"], axis=1), fans(corners))


def fans(polygons):
    """Return the triangles of polygons around their first corners."""
    expect(all(len(corners) >= 3 for corners in polygons), "fewer than three corners")
    return [
        [corners[0], corners[k], corners[k + 1]]
        for corners in polygons
        for k in range(1, len(corners) - 1)
    ]


def _ascii_lines(file):
    text = file.read_bytes().decode("latin-1").removeprefix("\xef\xbb\xbf")
    return re.sub("#[^\r\n]*", "", text.replace("\r\n", "\n").replace("\r", "\n"))


def _words(text):
    return re.findall(r"[^ \t\n\v\f]+", text)


def position(words):
    expect(len(words) >= 3, "short position")
    _ = [real_or_none(word) for word in words[3:]]
    return [real(word) for word in words[:3]]


def judge_obj(file):
    # Comments are gone before lines are joined.
    vertices, faces = [], []
    for line in _ascii_lines(file).replace("\\\n", " ").split("\n"):
        words = _words(line.removesuffix("\\"))
        if words[:1] == ["v"]:
            vertices.append(position(words[1:]))
        elif words[:1] == ["f"]:
            numbers = [whole(re.split("/", word)[0]) for word in words[1:]]
            expect(0 not in numbers, "no vertex 0")
            faces.append([k - 1 if k > 0 else len(vertices) + k for k in numbers])
    return mesh(vertices, fans(faces))


def judge_off(file):
    text = _ascii_lines(file)
    keyword = _words(text)[0]
    expect(keyword in ("OFF", "COFF", "NOFF", "CNOFF", "STOFF", "STCOFF", "STNOFF", "STCNOFF"), "?")
    rows = [_words(row) for row in text[text.index(keyword) + len(keyword) :].split("\n")]
    rows = [row for row in rows if row]
    counts = [whole(word) for word in rows.pop(0)]
    expect(len(counts) in (2, 3) and min(counts[:2]) > 0, "counts")
    expect(len(rows) == counts[0] + counts[1], "number of lines")
    vertices = [position(row) for row in rows[: counts[0]]]
    faces = rows[counts[0] :]
    for row in faces:
        expect(0 <= whole(row[0]) < len(row), "short face")
        _ = [real_or_none(word) for word in row[1 + whole(row[0]) :]]
    return mesh(
        vertices, fans([[whole(word) for word in row[1 : 1 + int(row[0])]] for row in faces])
    )


def read_vectors(file):
    found = LatentVectors.from_file(file)
    return {"ids": np.array(found.ids), "vectors": found.vectors}


def judge_vectors(file):
    if file.suffix == ".npy":
        array = np.load(file)
        ids = range(len(array))
    elif file.suffix == ".npz":
        with np.load(file) as archive:
            ids, array = archive["ids"], archive["vectors"]
        ids = [k.decode("utf-8", "replace") if isinstance(k, bytes) else k for k in ids.tolist()]
    else:
        text = file.read_bytes().decode("utf-8-sig")
        table = list(csv.reader(re.split("(?<=\n)|(?<=\r)(?!\n)", text), strict=True))
        rows = [[word.strip() for word in row] for row in table if any(w.strip() for w in row)]
        while rows and rows[0][0].lower() == "id":
            rows.pop(0)
        ids, array = [row[0] for row in rows], [[real(word) for word in row[1:]] for row in rows]
    ids = [str(name).strip() for name in ids]
    array = np.asarray(array)
    expect(array.ndim == 2 and array.size and array.dtype.kind in "fiub", "no vectors")
    expect(len(set(ids)) == len(ids) == len(array) and all(ids), "ids")
    expect(np.isfinite(array).all(), "not finite")
    return {"ids": np.array(ids), "vectors": array.astype(np.float64)}


def read_labels(file):
    bodies = load_bodies(file.parent, align=False)
    names = {"subject": bodies.subject_names, "pose": bodies.pose_names}
    found = {name: np.array([names[name][k] for k in getattr(bodies, name)]) for name in names}
    return found | {"ids": np.array(bodies.ids)}


def judge_labels(file):
    with open(file, encoding="utf-8-sig", newline="") as stream:
        first = re.split("[\r\n]", stream.read())[0]
        stream.seek(0)
        separator = max(",;\t", key=first.count)
        table = [[word.strip() for word in row] for row in csv.reader(stream, delimiter=separator)]
    heading = [name.lower() for name in table[0]]
    rows = {}
    for row in table[1:]:
        if any(row):
            name, *labels = (row[heading.index(c)] for c in ("file", "subject", "pose"))
            name = name.removesuffix(".off")
            expect(name not in rows and all(labels), "labels")
            rows[name] = labels
    ids = sorted(each.stem for each in file.parent.glob("*.off"))
    expect(sorted(rows) == ids, "names")
    subject, pose = zip(*(rows[name] for name in ids), strict=True)
    return {"subject": np.array(subject), "pose": np.array(pose), "ids": np.array(ids)}


def read_cla(file):
    return {name: np.array(ids) for name, ids in read_classes(file).items()}


def judge_cla(file):
    words = re.findall(r"[^ \t\r\n\v\f]+", file.read_bytes().decode("utf-8-sig"))
    expect(words[0].upper() == "PSB" and words[2].isascii() and words[2].isdigit(), "head")
    n_classes, n_meshes, words = int(words[2]), int(words[3]), words[4:]
    found = {}
    for _ in range(n_classes):
        name, parent, size = words[0], words[1], whole(words[2])
        expect(name not in found and (parent in ("0", "-1") or parent in found), "class")
        found[name] = words[3 : 3 + size]
        expect(len(found[name]) == size, "too few")
        words = words[3 + size :]
    ids = [name for members in found.values() for name in members]
    expect(not words and len(ids) == len(set(ids)) == n_meshes, "more words")
    return {name: np.array(members) for name, members in found.items() if members}


JUDGES = {
    "ply": (read_mesh, judge_ply),
    "obj": (read_mesh, judge_obj),
    "off": (read_mesh, judge_off),
    "npy": (lambda file: {"array": load_array(file)}, lambda file: {"array": np.load(file)}),
    "npz": (lambda file: load_arrays(file, []), lambda file: dict(arrays.Archive(file))),
    "vectors npz": (read_vectors, judge_vectors),
    "vectors npy": (read_vectors, judge_vectors),
    "vectors csv": (read_vectors, judge_vectors),
    "labels": (read_labels, judge_labels),
    "classes": (read_cla, judge_cla),
    "model npz": (arrays.read_model, arrays.judge_model),
    "model pickle": (arrays.read_model, arrays.judge_model),
    "basis": (arrays.read_basis, arrays.judge_basis),
    "bodies": (arrays.read_bodies, arrays.judge_bodies),
    "amass": (arrays.read_amass, arrays.judge_amass),
    "index": (arrays.read_index, arrays.judge_index),
    "motion": (arrays.read_motion, arrays.judge_motion),
}
