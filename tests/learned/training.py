"""Training with PyTorch, which the everyday tests do without: bash .ci/learned."""

import numpy as np
import pytest
import torch

import riemhuman as rh
from riemhuman.errors import ArgumentError, FileFormatError
from riemhuman.learned.networks import initial_network, network
from riemhuman.learned.parts import find_parts
from riemhuman.learned.point_clouds import cloud_features, initial_cloud
from riemhuman.learned.training import trained
from riemhuman.learned.training_bodies import random_bodies

SMALL = {"n_parts": 12, "n_hidden": 8}


@pytest.fixture(scope="module")
def model():
    return rh.datasets.load_open_model("coarse")


@pytest.fixture(scope="module")
def bodies(model):
    return random_bodies(model, 12, 3, rng=0)


def shape_pose(model, **options):
    options = {"n_steps": 60, "batch_size": 4, "n_shape": 4, "n_pose": 16, **SMALL} | options
    return rh.learned.ShapePoseCodes(model.template, **options)


def metric_codes(model, **options):
    space = rh.AlignedSurfaces(model.template)
    metric = rh.ElasticMetric(space, a=0.0, lam=0.0, c=1.0)
    return rh.learned.MetricCodes(metric, **({"n_codes": 8, "n_steps": 60, **SMALL} | options))


def clouds(model, **options):
    sizes = {"n_points": 60, "n_hidden": 8, "n_features": 16, "n_eigenvalues": 4, "n_steps": 60}
    return rh.learned.IntrinsicExtrinsicCodes(model.template, **(sizes | options))


MAKERS = [shape_pose, metric_codes, clouds]


@pytest.mark.parametrize("make", MAKERS)
def test_learns_saves_and_loads_and_is_the_same_every_time(make, model, bodies, tmp_path):
    codes = make(model).fit(bodies.points, bodies.subject)
    assert codes.losses_[-10:].mean() < 0.8 * codes.losses_[:5].mean()
    found = codes.transform(bodies.points[:3])
    codes.save(tmp_path / "codes.npz")
    loaded = type(codes).load(tmp_path / "codes.npz")
    np.testing.assert_array_equal(loaded.transform(bodies.points[:3]), found)
    loaded.save(tmp_path / "again.npz")
    again = make(model).fit(bodies.points, bodies.subject)
    np.testing.assert_array_equal(again.transform(bodies.points[:3]), found)
    again.save(tmp_path / "third.npz")
    written = [(tmp_path / f"{name}.npz").read_bytes() for name in ("codes", "again", "third")]
    assert written[0] == written[1] == written[2]


@pytest.mark.parametrize("make", MAKERS)
def test_goes_on_from_a_checkpoint_bit_for_bit(make, model, bodies, tmp_path, monkeypatch):
    whole = make(model).fit(bodies.points, bodies.subject)
    file = tmp_path / "checkpoint.npz"
    monkeypatch.setattr("riemhuman.learned.training.STEPS_BETWEEN", 20)
    steps = iter(range(47))

    class Killed(BaseException):
        pass

    adam = torch.optim.Adam.step

    def step(self, *arguments):
        if next(steps, None) is None:
            raise Killed
        return adam(self, *arguments)

    with monkeypatch.context() as patch:
        patch.setattr(torch.optim.Adam, "step", step)
        with pytest.raises(Killed):
            make(model).fit(bodies.points, bodies.subject, checkpoint=file)
    assert file.exists()
    resumed = make(model).fit(bodies.points, bodies.subject, checkpoint=file)
    np.testing.assert_array_equal(resumed.losses_, whole.losses_)
    for name, array in whole.parameters_.items():
        np.testing.assert_array_equal(resumed.parameters_[name], array)


def test_checkpoint_of_another_training_is_refused(model, bodies, tmp_path, monkeypatch):
    file = tmp_path / "checkpoint.npz"
    monkeypatch.setattr("riemhuman.learned.training.STEPS_BETWEEN", 10)
    metric_codes(model, n_steps=20).fit(bodies.points, checkpoint=file)
    with pytest.raises(FileFormatError, match="checkpoint from another training"):
        metric_codes(model, n_steps=20).fit(bodies.points[:24], checkpoint=file)


def test_networks_agree_with_pytorch():
    rng = np.random.default_rng(0)
    parameters = initial_network("some", 30, 20, 10, rng) | initial_cloud(8, 16, rng)
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
    found = parts.surfaces(torch.tensor(np.float32(features)), torch, operator).numpy()
    np.testing.assert_allclose(found, parts.surfaces(features), atol=1e-5)


def test_number_of_threads_is_given_back_and_infinite_losses_are_refused():
    before = torch.get_num_threads()
    start = {"x": np.ones(3, dtype=np.float32)}

    def grows(torch, parameters, data, rng):
        return parameters["x"].sum() * float("inf")

    with pytest.raises(ArgumentError, match="loss is not finite at step 0"):
        trained(start, {}, grows, n_steps=3, seed=0)
    assert torch.get_num_threads() == before


def test_labels_must_name_people_in_several_poses(model, bodies):
    with pytest.raises(ArgumentError, match="at least two people in at least two poses"):
        shape_pose(model).fit(bodies.points, np.arange(len(bodies.points)))
    with pytest.raises(ArgumentError, match="one label per body"):
        shape_pose(model).fit(bodies.points, bodies.subject[:-1])
