"""Training of networks with PyTorch: seeded, on one thread, with checkpoints."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy import ndarray
from tqdm import tqdm

from riemhuman.errors import ArgumentError, FileFormatError
from riemhuman.io.arrays import load_arrays, save_arrays
from riemhuman.learned._networks import NetworkSizes, cloud_shapes, shapes_of_networks
from riemhuman.learned._weight_files import VERSION
from riemhuman.optional import import_optional
from riemhuman.surfaces import Template

Loss = Callable[[ModuleType, dict[str, Any], Mapping[str, Any], np.random.Generator], Any]

STEPS_BETWEEN = 200
"""Number of steps between two checkpoints."""

_WARM_UP = 0.05
_MOMENTS = ("exp_avg", "exp_avg_sq")


@dataclass(frozen=True)
class Training:
    """How networks are trained, and whether a checkpoint is kept and a progress bar shown."""

    n_steps: int = 3000
    batch_size: int = 32
    learning_rate: float = 2e-3
    seed: int = 0
    checkpoint: str | os.PathLike[str] | None = None
    progress: bool = False


def save_weights(
    path: str | os.PathLike[str],
    kind: str,
    settings: Mapping[str, int],
    template: Template,
    arrays: Mapping[str, ndarray],
) -> None:
    """Write a network of a class by its name; the file appears whole or not at all."""
    vertices = template.vertices.astype(np.float32)
    if not np.array_equal(vertices, template.vertices):
        vertices = template.vertices
    fields = {
        "format_version": np.array(VERSION),
        "kind": np.array(kind),
        **{name: np.array(value) for name, value in settings.items()},
        "template_vertices": vertices,
        "template_faces": template.faces.astype(np.int32),
    }
    save_arrays(path, {**fields, **arrays}, compressed=True)


def train(
    parameters: Mapping[str, ndarray],
    data: Mapping[str, ndarray],
    loss: Loss,
    training: Training,
) -> tuple[dict[str, ndarray], ndarray]:
    """Train networks with Adam, and return their parameters in half precision, and the losses.

    `loss` takes the module torch, the parameters and the data as tensors, and a generator for the
    batch. Each step has a generator of its own, so that a training continued from a checkpoint, an
    .npz file written every 200 steps, gives the same result, bit for bit, as one without
    interruption. Training runs on one thread, since sums over several depend on their number. The
    learning rate rises at first, then falls to 0 as half a cosine.
    """
    torch = import_optional("torch", "learned")
    file = None if training.checkpoint is None else Path(training.checkpoint)
    n_steps, seed, learning_rate = training.n_steps, training.seed, training.learning_rate
    losses = np.zeros(n_steps)
    origin = _origin(parameters, data, n_steps, seed, learning_rate)
    with _one_thread(torch):
        tensors = {name: torch.tensor(array) for name, array in parameters.items()}
        fixed = {name: torch.tensor(np.float32(array)) for name, array in data.items()}
        for tensor in tensors.values():
            tensor.requires_grad_(True)
        adam = torch.optim.Adam(tensors.values(), lr=learning_rate, foreach=False)
        first = 0
        if file is not None and file.exists():
            first = _restore(torch, file, origin, tensors, adam, losses)
        bar = tqdm(range(first, n_steps), disable=not training.progress, unit="step")
        for step in bar:
            for group in adam.param_groups:
                group["lr"] = learning_rate * _pace(step, n_steps)
            adam.zero_grad()
            value = loss(torch, tensors, fixed, np.random.default_rng([seed, step]))
            value.backward()
            losses[step] = float(value.detach())
            if not np.isfinite(losses[step]):
                raise ArgumentError(
                    f"the loss is not finite at step {step}; try a smaller learning_rate"
                )
            torch.nn.utils.clip_grad_norm_(tensors.values(), 1.0)
            adam.step()
            if step % 20 == 0:
                bar.set_postfix(loss=f"{losses[max(0, step - 50) : step + 1].mean():.4g}")
            if file is not None and (step + 1) % STEPS_BETWEEN == 0:
                _keep(file, origin, tensors, adam, losses, step + 1)
    trained = {name: tensor.detach().numpy() for name, tensor in tensors.items()}
    return {name: array.astype(np.float16) for name, array in trained.items()}, losses


def initial_networks(
    networks: Mapping[str, NetworkSizes], rng: np.random.Generator
) -> dict[str, ndarray]:
    """Return initial parameters: a random linear part, and hidden layers without effect."""
    initial = {}
    for key, shape in shapes_of_networks(networks).items():
        is_random = key[-1] in "ABL"
        array = rng.standard_normal(shape) / np.sqrt(shape[0]) if is_random else np.zeros(shape)
        initial[key] = array.astype(np.float32)
    return initial


def initial_cloud(n_hidden: int, n_features: int, rng: np.random.Generator) -> dict[str, ndarray]:
    """Return initial parameters of `cloud_features`."""
    shapes = cloud_shapes(n_hidden, n_features)
    return {
        name: (rng.standard_normal(shape) * np.sqrt(2.0 / shape[0])).astype(np.float32)
        for name, shape in shapes.items()
        if len(shape) == 2
    } | {
        # Random biases activate features at different places of the cloud.
        name: (0.5 * rng.standard_normal(shape)).astype(np.float32)
        for name, shape in shapes.items()
        if len(shape) == 1
    }


def rotation_matrices(vectors: Any) -> Any:
    """Return the rotation matrices of rotation vectors, tensors of PyTorch (Rodrigues' formula)."""
    torch = import_optional("torch", "learned")
    squares = (vectors * vectors).sum(-1)
    angles = torch.sqrt(squares + 1e-12)
    sine, half = torch.sin(angles) / angles, torch.sin(0.5 * angles) / angles
    cosine = 2.0 * half * half
    x, y, z = (vectors[..., i] for i in range(3))
    entries = [
        1.0 - cosine * (y * y + z * z),
        cosine * x * y - sine * z,
        cosine * x * z + sine * y,
        cosine * x * y + sine * z,
        1.0 - cosine * (x * x + z * z),
        cosine * y * z - sine * x,
        cosine * x * z - sine * y,
        cosine * y * z + sine * x,
        1.0 - cosine * (x * x + y * y),
    ]
    return torch.stack(entries, -1).reshape(*vectors.shape, 3)


def _pace(step: int, n_steps: int) -> float:
    rise = max(1.0, _WARM_UP * n_steps)
    return float(min(1.0, (step + 1) / rise) * 0.5 * (1.0 + np.cos(np.pi * step / n_steps)))


def _origin(parameters: Any, data: Any, *settings: Any) -> str:
    """Return a digest of the initial parameters, the data and the settings of a training."""
    digest = hashlib.sha256(repr(settings).encode())
    for arrays in (parameters, data):
        for name in sorted(arrays):
            digest.update(name.encode())
            digest.update(np.ascontiguousarray(arrays[name], dtype=np.float32).tobytes())
    return digest.hexdigest()


def _keep(file: Path, origin: str, tensors: Any, adam: Any, losses: ndarray, step: int) -> None:
    arrays = {"origin": np.array(origin), "step": np.array(step), "losses": losses}
    for name, tensor in tensors.items():
        arrays[f"parameter {name}"] = tensor.detach().numpy()
        for moment in _MOMENTS:
            arrays[f"{moment} {name}"] = adam.state[tensor][moment].numpy()
    save_arrays(file, arrays)


def _restore(
    torch: ModuleType, file: Path, origin: str, tensors: Any, adam: Any, losses: ndarray
) -> int:
    pairs = [(kind, name) for name in tensors for kind in ("parameter", *_MOMENTS)]
    names = [f"{kind} {name}" for kind, name in pairs]
    arrays = load_arrays(file, ["origin", "step", "losses", *names], [])
    if arrays["origin"].shape != () or str(arrays["origin"]) != origin:
        raise FileFormatError(
            f"{file} is a checkpoint from another training, with other data, parameters or seed; "
            "remove it, or name another file"
        )
    shapes = {f"{kind} {name}": tuple(tensors[name].shape) for kind, name in pairs}
    shapes |= {"step": (), "losses": losses.shape}
    if any(arrays[name].shape != shape for name, shape in shapes.items()):
        raise FileFormatError(f"{file} is damaged: its arrays have other shapes than the networks")
    step = int(arrays["step"])
    losses[:] = arrays["losses"]
    for name, tensor in tensors.items():
        with torch.no_grad():
            tensor.copy_(torch.tensor(arrays[f"parameter {name}"]))
        adam.state[tensor] = {
            "step": torch.tensor(float(step)),
            **{moment: torch.tensor(arrays[f"{moment} {name}"]) for moment in _MOMENTS},
        }
    return step


@contextmanager
def _one_thread(torch: ModuleType) -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
