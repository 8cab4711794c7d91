"""Files of every kind that is read, written from a grammar, with a few of their fields changed.

A writer passes every number, name, type and line end through `Fields`, which hands it on as it is
or, for a few of them, at the edge of its type, misspelt or missing: what a file says of itself is
wrong, and the rest of it is right.
"""

from random import Random

from trust import structured_arrays, structured_text
from trust.structured_fields import Fields

WRITERS = {
    "ply": structured_text.write_ply,
    "obj": structured_text.write_obj,
    "off": structured_text.write_off,
    "npy": structured_arrays.write_npy,
    "npz": structured_arrays.write_npz,
    "vectors npz": structured_arrays.write_vectors_npz,
    "vectors npy": structured_arrays.write_vectors_npy,
    "vectors csv": structured_text.write_vectors_csv,
    "labels": structured_text.write_labels,
    "classes": structured_text.write_classes,
    "model npz": structured_arrays.write_model_npz,
    "model pickle": structured_arrays.write_model_pickle,
    "basis": structured_arrays.write_basis,
    "bodies": structured_arrays.write_bodies,
    "amass": structured_arrays.write_amass,
    "index": structured_arrays.write_index,
    "motion": structured_arrays.write_motion,
}


def write(kind, seed, number):
    """Return a file, or several by their names, and how many of its fields are changed."""
    writer = WRITERS[kind]
    label = f"{seed} {kind} {number}"
    fields = Fields(Random(label))
    writer(Random(label), fields)
    rng = Random(label + " changes")
    changed = min(rng.choice([0, 0, 1, 1, 1, 2, 3]), fields.count)
    chosen = frozenset(rng.sample(range(fields.count), changed))
    files = writer(Random(label), Fields(rng, chosen))
    if rng.random() < 0.15:
        name = rng.choice(list(files))
        files[name] = _damaged(files[name], rng)
        changed += 1
    return files, changed


def _damaged(content, rng):
    place = rng.randrange(len(content) + 1)
    far = min(len(content), place + rng.choice([1, 1, 4, 50]))
    spot = bytes([rng.choice([0, 1, 10, 13, 32, 45, 95, 127, 128, 255])]) * rng.choice([1, 1, 2, 8])
    return rng.choice(
        [
            content[:place],
            content[:place] + content[far:],
            content[:place] + spot + content[place:],
            content[:place] + spot + content[place + len(spot) :],
            content + spot,
            content[:far] + content[place:],
        ]
    )
