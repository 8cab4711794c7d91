"""Training with PyTorch, which the everyday tests do without: python .ci/jobs.py oracles."""

import numpy as np
import pytest
import torch
from train_codes import find_parts, train_intrinsic_extrinsic, train_shape_pose
from training import Training, initial_cloud, initial_networks, rotation_matrices
from training_bodies import random_bodies

import riemhuman as rh
from riemhuman.learned._networks import NetworkSizes, cloud_features, network
from riemhuman.learned.intrinsic_extrinsic_codes import CloudSizes
from riemhuman.learned.shape_pose_codes import ShapePoseSizes


@pytest.fixture(scope="module")
def model():
    return rh.datasets.load_open_model("coarse")


@pytest.fixture(scope="module")
def bodies(model):
    return random_bodies(model, 12, 3, rng=0)


def shape_pose(model, bodies, file, **options):
    sizes = ShapePoseSizes(n_shape=4, n_pose=16, n_parts=12, n_hidden=8)
    how = Training(**({"n_steps": 60, "batch_size": 4} | options))
    return train_shape_pose(model.template, bodies.points, bodies.subject, file, sizes, how)


def clouds(model, bodies, file, **options):
    sizes = CloudSizes(n_points=60, n_hidden=8, n_features=16, n_eigenvalues=4)
    how = Training(**({"n_steps": 60, "learning_rate": 1e-3} | options))
    return train_intrinsic_extrinsic(model.template, bodies.points, file, sizes, how)


TRAINERS = [shape_pose, clouds]


@pytest.mark.parametrize("make", TRAINERS)
def test_learns_saves_and_loads_and_is_the_same_every_time(make, model, bodies, tmp_path):
    codes, losses = make(model, bodies, tmp_path / "codes.npz")
    assert losses[-10:].mean() < 0.8 * losses[:5].mean()
    found = codes.transform(bodies.points[:3])
    codes.save(tmp_path / "saved.npz")
    make(model, bodies, tmp_path / "again.npz")
    written = [(tmp_path / f"{name}.npz").read_bytes() for name in ("codes", "saved", "again")]
    assert written[0] == written[1] == written[2]
    loaded = type(codes)(tmp_path / "again.npz")
    np.testing.assert_array_equal(loaded.transform(bodies.points[:3]), found)


def test_networks_agree_with_pytorch():
    rng = np.random.default_rng(0)
    parameters = initial_networks({"some": NetworkSizes(30, 20, 10)}, rng) | initial_cloud(
        8, 16, rng
    )
    parameters = {name: array + 0.1 for name, array in parameters.items()}
    x = rng.standard_normal((5, 30))
    tensors = {name: torch.tensor(array) for name, array in parameters.items()}
    found = network(tensors, "some", torch.tensor(np.float32(x)), torch).numpy()
    wanted = network(parameters, "some", x)
    np.testing.assert_allclose(found, wanted, atol=1e-5 * np.abs(wanted).max())
    cloud = rng.standard_normal((5, 40, 3))
    found = cloud_features(tensors, torch.tensor(np.float32(cloud)), torch).numpy()
    wanted = cloud_features(parameters, cloud)
    np.testing.assert_allclose(found, wanted, atol=1e-5 * np.abs(wanted).max())


def test_surfaces_of_parts_agree_with_pytorch(model, bodies):
    parts = find_parts(model.template, bodies.points, 12, np.random.default_rng(0))
    features, _ = parts.split(bodies.points[:4])
    operator = torch.tensor(np.float32(parts.operator))
    tensor = torch.tensor(np.float32(features))
    found = parts.surfaces(tensor, torch, operator, rotation_matrices).numpy()
    np.testing.assert_allclose(found, parts.surfaces(features), atol=1e-5)
