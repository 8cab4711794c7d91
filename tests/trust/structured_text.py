"""Meshes and tables, most of them text, written from a grammar."""

import struct

import numpy as np
from trust.structured_fields import NAMES

PLY_CODES = {"char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I"}
PLY_CODES |= {"int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I"}
PLY_CODES |= {"float": "f", "double": "d", "float32": "f", "float64": "d"}
WHOLE = [name for name, code in PLY_CODES.items() if code not in "fd"]


def write_ply(rng, fields):
    order, encoding = rng.choice([("", "ascii"), ("<", "binary_little_endian")] * 2
                                 + [(">", "binary_big_endian")])  # fmt: skip
    end = rng.choice(["\n", "\n", "\r\n", "\r"])
    n_vertices = rng.randint(3, 7)
    position = rng.choice(["float", "double", "float32", "short", "int"])
    noise = [(rng.choice(list(PLY_CODES)), None, f"n{k}") for k in range(rng.choice([0, 0, 1, 2]))]
    ragged = (rng.choice(WHOLE), rng.choice(["uchar", "ushort", "int"]), "ragged")
    extra = [*noise, *([ragged] if rng.random() < 0.3 else [])]
    corner = (rng.choice(WHOLE), rng.choice(["uchar", "int", "uint8", "short"]), "vertex_indices")
    elements = [
        ("vertex", n_vertices, [*extra, *((position, None, axis) for axis in "xyz")]),
        ("face", rng.randint(1, 5), rng.choice([[corner], [corner, ragged], [*noise, corner]])),
    ]
    if rng.random() < 0.3:
        elements.insert(rng.randrange(3), ("strip", rng.randint(0, 3), [ragged]))
    rng.shuffle(elements)
    header = ["ply", f"format {fields.of(encoding, ['ascii', 'binary_big_endian', 'text'])} 1.0"]
    header += ["comment a body"] * rng.randrange(2)
    body = b""
    for name, n_rows, properties in elements:
        header.append(f"element {fields.of(name, NAMES)} {fields.word(str(fields.whole(n_rows)))}")
        for kind, length_kind, label in fields.some(properties):
            kinds = [length_kind, kind] if length_kind else [kind]
            said = " ".join(fields.of(each, list(PLY_CODES)) for each in kinds)
            header.append(f"property {'list ' * bool(length_kind)}{said} {fields.of(label, NAMES)}")
        for _ in range(n_rows):
            words = []
            for kind, length_kind, label in properties:
                length = 1
                if length_kind:
                    length = 3 if label == "vertex_indices" else rng.randrange(4)
                    length = fields.of(length, [2, 4]) if rng.random() < 0.1 else length
                    words.append(_ply_number(length_kind, fields.whole(length), order, fields))
                for _ in range(length):
                    number = rng.randrange(n_vertices)
                    if PLY_CODES[kind] in "fd":
                        number = fields.real(round(rng.uniform(-2, 2), 4))
                    else:
                        number = fields.whole(number)
                    words.append(_ply_number(kind, number, order, fields))
            line = b" ".join(words) + fields.line_end(end).encode() if not order else b""
            body += b"".join(words) if order else line
    lines = [*fields.some(header), "end_header"]
    return {"a.ply": "".join(line + fields.line_end(end) for line in lines).encode() + body}


def _ply_number(kind, number, order, fields):
    if not order:
        return fields.word(repr(number)).encode()
    code = PLY_CODES[kind]
    if code == "f":
        with np.errstate(over="ignore"):
            return np.array(number, order + "f4").tobytes()
    if code == "d":
        return struct.pack(order + code, number)
    size = struct.calcsize(code)
    return (int(number) % 2 ** (8 * size)).to_bytes(size, "little" if order == "<" else "big")


def write_obj(rng, fields):
    end = rng.choice(["\n", "\n", "\r\n", "\r"])
    lines, n_seen = ["# a body", "o body"], 0
    for _ in range(rng.randint(1, 4)):
        for _ in range(rng.randint(3, 5)):
            position = [repr(fields.real(round(rng.uniform(-2, 2), 3))) for _ in range(3)]
            colour = ["0.5"] * rng.choice([0, 0, 0, 1, 3])
            lines.append(" ".join(["v", *map(fields.word, fields.some(position + colour))]))
            n_seen += 1
        lines += ["vn 0 0 1", "vt 0 0"] * rng.randrange(2)
        for _ in range(rng.randint(1, 3)):
            corners = [rng.randint(1, n_seen) for _ in range(3)]
            if rng.random() < 0.3:
                corners = [corner - 1 - n_seen for corner in corners]
            pattern = rng.choice(["{}", "{}", "{}/1", "{}//1", "{}/1/1"])
            words = [pattern.format(fields.word(str(fields.whole(c)))) for c in corners]
            between = rng.choice([" "] * 9 + [f" \\{end}"])
            lines.append("f " + between.join(fields.some(words)))
    lines = fields.some(lines)
    text = "".join(line + fields.of("", [" # b", " \\", "\t", "#"]) + fields.line_end(end)
                   for line in lines)  # fmt: skip
    return {"a.obj": text.encode()}


def write_off(rng, fields):
    end = rng.choice(["\n", "\n", "\r\n", "\r"])
    n_vertices, n_faces = rng.randint(3, 6), rng.randint(1, 4)
    keyword = fields.of(
        rng.choice(["OFF", "OFF", "COFF", "NOFF", "STOFF"]), ["4OFF", "off", "BOFF"]
    )
    counts = [fields.word(str(fields.whole(n))) for n in (n_vertices, n_faces, 0)]
    rows = [" ".join(fields.some(counts[: rng.choice([2, 3, 3])]))]
    for _ in range(n_vertices):
        position = [fields.word(repr(fields.real(round(rng.uniform(-2, 2), 3)))) for _ in range(3)]
        rows.append(" ".join(fields.some(position)) + " 255 0 0" * (keyword == "COFF"))
    for _ in range(n_faces):
        corners = [str(fields.whole(rng.randrange(n_vertices))) for _ in range(3)]
        face = [str(fields.whole(3)), *map(fields.word, corners)]
        rows.append(" ".join(fields.some(face)) + rng.choice(["", "", " 1", " 0.5 1 0"]))
    first = rng.choice([keyword + end, keyword + " ", f"# a{end}{keyword}{end}"])
    text = first + "".join(
        row + fields.of("", ["#", " #b", " 7"]) + fields.line_end(end) for row in fields.some(rows)
    )
    return {"a.off": text.encode()}


def write_vectors_csv(rng, fields):
    end = rng.choice(["\n", "\r\n", "\r"])
    lines = [["id", "x", "y"]] if rng.random() < 0.5 else []
    for number in range(rng.randint(1, 4)):
        row = [fields.word(repr(fields.real(round(rng.uniform(-9, 9), 2)))) for _ in range(2)]
        quote = rng.choice(["", "", '"'])
        lines.append([quote + fields.of(f"b{number}", NAMES) + quote, *fields.some(row)])
    text = "".join(fields.of(",", [";", ",,", "\t"]).join(line) + fields.line_end(end)
                   for line in fields.some(lines))  # fmt: skip
    return {"a.csv": text.encode(fields.of("utf-8", ["utf-8-sig", "utf-16", "cp1252"]), "replace")}


MESH = b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 %d\n3 0 1 2\n"


def write_labels(rng, fields):
    n, end = rng.randint(1, 3), rng.choice(["\n", "\r\n", "\r"])
    separator = rng.choice([",", ";", "\t"])
    lines = [fields.some(["file", "subject", "pose"])]
    for number in range(n):
        words = [f"b{number}", rng.choice(["Ann", "Bob", '"Cy, a"', '"D;\n"']), str(number % 2)]
        lines.append([fields.of(fields.word(word), [*NAMES, "b1"]) for word in words])
    text = "".join(fields.of(separator, [",", ";", "\t"]).join(line) + fields.line_end(end)
                   for line in fields.some(lines))  # fmt: skip
    files = {f"b{number}.off": MESH % number for number in range(n)}
    content = text.encode(fields.of("utf-8", ["utf-8-sig", "utf-16", "cp1252"]), "replace")
    return {"labels.csv": content} | files


def write_classes(rng, fields):
    end = rng.choice(["\n", "\r\n", "\r", " "])
    n_classes, ids = rng.randint(0, 4), 0
    words = []
    for number in range(n_classes):
        size = rng.randint(0, 3)
        words += [fields.of(f"c{number}", NAMES), fields.of("0", ["c0", "c3", "-1", ""])]
        words.append(fields.word(str(fields.whole(size))))
        words += [fields.of(str(ids + k), NAMES) for k in range(size)]
        ids += size
    counts = [fields.word(str(fields.whole(n))) for n in (n_classes, ids)]
    words = fields.some([fields.of("PSB", ["psb", "OFF"]), "1", *counts, *words])
    return {"a.cla": "".join(word + fields.line_end(end) for word in words).encode()}
