"""Arrays of other packages, and what is no array, at public functions: right, or a typed error."""

import numpy as np
import pandas
import pytest
from open_bodies import coarse_bodies

import riemhuman as rh
from riemhuman.errors import ArgumentError, ArgumentTypeError, RiemhumanError

N_BODIES = 3


class Tensor:
    """A tensor of another package, which may refuse to become an array of NumPy."""

    def __init__(self, values, error=None):
        self.values, self.error = np.asarray(values), error
        self.shape, self.ndim, self.dtype = self.values.shape, self.values.ndim, "torch.float32"

    def __len__(self):
        return len(self.values)

    def __getitem__(self, index):
        return Tensor(self.values[index], self.error)

    def __array__(self, dtype=None, copy=None):
        if self.error is not None:
            raise self.error
        return self.values if dtype is None else self.values.astype(dtype)


GRADIENTS = RuntimeError("Can't call numpy() on Tensor that requires grad.")
BFLOAT16 = TypeError("Got unsupported ScalarType BFloat16")

RIGHT = {
    "tensor": Tensor,
    "list of tensors": lambda array: [Tensor(part) for part in array],
    "nested lists": lambda array: array.tolist(),
    "extended precision": lambda array: array.astype(np.longdouble),
}
WRONG = {
    "requires gradients": lambda array: Tensor(array, GRADIENTS),
    "list of tensors that require gradients": lambda array: [Tensor(p, GRADIENTS) for p in array],
    "ragged": lambda array: [part[: k + 1].tolist() for k, part in enumerate(array)],
    "complex": lambda array: array + 0j,
    "nothing": lambda array: None,
}


@pytest.fixture(scope="module")
def world():
    bodies = coarse_bodies()[:N_BODIES]
    space = rh.AlignedSurfaces(bodies.template)
    return bodies, rh.ElasticMetric(space, 0.0, 0.0, 1.0)


DOORS = {
    "dist": lambda b, m, x: m.dist(x, b.points),
    "dist_pairwise": lambda b, m, x: m.dist_pairwise(x),
    "cdist": lambda b, m, x: np.stack(list(m.cdist(x, b.points))),
    "to_fields": lambda b, m, x: m.space.to_fields(x)[1],
    "measure": lambda b, m, x: rh.measurements.Measurements(b.model, ["volume"]).measure(x).values,
    "procrustes": lambda b, m, x: rh.procrustes(x, to=b.template.vertices),
    "transform": lambda b, m, x: rh.LearnedMetric(m).fit(x, [0, 0, 1]).transform(x),
    "neighbours": lambda b, m, x: rh.NearestNeighbors(m).fit(x).kneighbors(b.points, 1)[0],
    "dtw": lambda b, m, x: rh.motions.DynamicTimeWarping(m).dist(x, b.points),
    "areas": lambda b, m, x: rh.surfaces.triangle_areas(x, b.template.faces),
    "volumes": lambda b, m, x: rh.surfaces.signed_volume(x, b.template.faces),
}


@pytest.mark.parametrize("door", DOORS)
def test_arrays_of_other_packages_give_the_same(door, world):
    bodies, metric = world
    expected = DOORS[door](bodies, metric, bodies.points)
    for convert in RIGHT.values():
        found = DOORS[door](bodies, metric, convert(bodies.points))
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("door", DOORS)
def test_what_is_no_array_of_real_numbers_is_refused(door, world):
    bodies, metric = world
    for convert in WRONG.values():
        with pytest.raises(RiemhumanError):
            DOORS[door](bodies, metric, convert(bodies.points))


def test_errors_say_how_a_tensor_is_passed(world):
    bodies, metric = world
    for error in (GRADIENTS, BFLOAT16):
        with pytest.raises(ArgumentTypeError, match=r"points.* cannot be read .*detach\(\)\.cpu"):
            metric.dist_pairwise(Tensor(bodies.points, error))


def test_batches_of_different_lengths_are_named(world):
    model = world[0].model
    betas, pose = np.zeros((3, model.n_betas)), np.zeros((4, model.n_joints, 3))
    for function in (model, model.joints):
        with pytest.raises(ArgumentError, match=r"betas and pose must be .*\(3,\) and \(4,\)"):
            function(betas, pose)
        with pytest.raises(ArgumentError, match=r"pose and trans must be"):
            function(None, pose.reshape(4, -1), np.zeros((2, 3)))
        assert function(betas[:, None], pose).shape[:2] == (3, 4)
        assert function(betas[0], pose).shape[0] == 4


def test_measurements_in_a_series():
    wanted = pandas.Series({"stature": 1.7})
    found = rh.measurements.model_from_measurements(wanted, resolution="coarse")
    assert found.values["stature"] == pytest.approx(1.7, abs=1e-3)
    with pytest.raises(ArgumentError, match="values must map names"):
        rh.measurements.model_from_measurements([1.7], resolution="coarse")
    empty = pandas.Series({"stature": pandas.NA})
    with pytest.raises(RiemhumanError, match="stature"):
        rh.measurements.model_from_measurements(empty, resolution="coarse")
