"""Model vectors: what a fit found, pose distances by rotation, surfaces that do not fit."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from riemhuman.descriptors import ModelPoseVectors, ModelShapeVectors
from riemhuman.errors import ArgumentError
from riemhuman.surfaces import Template

FACES = np.array([[0, 1, 2], [0, 2, 3]])


class Model:
    """A model whose fit tells the surfaces apart by their first vertex."""

    template = Template(np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), FACES)
    parents = np.array([-1, 0, 1])

    def fit(self, points):
        number = points[:, 0, 0]
        pose = np.zeros((len(points), 3, 3))
        pose[:, 0, 1], pose[:, 2, 0] = 100 * number, number
        return SimpleNamespace(betas=np.stack([number, 2 * number], axis=1), pose=pose)


def surfaces(numbers):
    points = np.zeros((len(numbers), 4, 3))
    points[:, 0, 0] = numbers
    return points


def test_descriptors_of_one_model_share_its_fit():
    fitted = []

    class Counting(Model):
        def fit(self, points):
            fitted.append(len(points))
            return super().fit(points)

    meshes = [(points, FACES) for points in surfaces([0.5, 2.0])]
    one, other = Counting(), Counting()
    sharing = [
        ModelShapeVectors(one),
        ModelPoseVectors(one),
        ModelPoseVectors(one, "rotation", root=False),
        ModelShapeVectors(other),
    ]
    vectors, seconds = ModelShapeVectors.describe_together(sharing, meshes)
    assert fitted == [2, 2]
    assert min(seconds) > 0
    for descriptor, found in zip(sharing, vectors, strict=True):
        np.testing.assert_array_equal(found, descriptor.describe_all(meshes))
    wrong = [(np.zeros((3, 3)), FACES)]
    with pytest.raises(ArgumentError, match="vertices of body 0 has 3 vertices per surface"):
        ModelShapeVectors.describe_together(sharing, wrong)


def test_vectors_are_those_of_the_fit():
    meshes = [(points, FACES) for points in surfaces([0.5, 2.0])]
    shape = ModelShapeVectors(Model())
    np.testing.assert_array_equal(shape.describe(*meshes[1]), [2.0, 4.0])
    np.testing.assert_array_equal(shape.describe_all(meshes), [[0.5, 1.0], [2.0, 4.0]])
    bodies = SimpleNamespace(points=surfaces([0.5, 2.0]), template=Model.template)
    np.testing.assert_array_equal(shape.describe_all(bodies), [[0.5, 1.0], [2.0, 4.0]])
    pose = ModelPoseVectors(Model())
    assert pose.describe(*meshes[1]).tolist() == [0, 200, 0, 0, 0, 0, 2, 0, 0]
    without_root = ModelPoseVectors(Model(), root=False)
    assert without_root.describe(*meshes[1]).tolist() == [0, 0, 0, 2, 0, 0]


def test_distances_by_rotation():
    rng = np.random.default_rng(4)
    poses = rng.normal(scale=2.0, size=(5, 4, 3))
    poses[1] = poses[0]
    poses[2] = poses[0] + 1e-9
    found = ModelPoseVectors(Model(), "rotation").distances(poses.reshape(5, -1))
    turns = Rotation.from_rotvec(poses.reshape(-1, 3))
    for i in range(5):
        for j in range(5):
            between = turns[4 * i : 4 * i + 4] * turns[4 * j : 4 * j + 4].inv()
            np.testing.assert_allclose(found[i, j], between.magnitude().sum(), atol=1e-13)
    assert found[0, 1] == 0
    assert 0 < found[0, 2] < 1e-7


def test_rotations_do_not_jump_at_half_a_turn():
    rows = np.array([[0, np.pi - 0.01, 0], [0, -np.pi + 0.01, 0]])
    model = Model()
    np.testing.assert_allclose(ModelPoseVectors(model, "rotation").distances(rows)[0, 1], 0.02)
    np.testing.assert_allclose(ModelPoseVectors(model).distances(rows)[0, 1], 2 * np.pi - 0.02)


def test_surfaces_that_are_not_registered_to_the_model():
    shape = ModelShapeVectors(Model())
    with pytest.raises(ArgumentError, match="5 vertices per surface .*the template has 4"):
        shape.describe(np.zeros((5, 3)), FACES)
    with pytest.raises(ArgumentError, match="faces of body 1 must be the triangles of"):
        shape.describe_all([(np.zeros((4, 3)), FACES), (np.zeros((4, 3)), FACES[::-1])])
