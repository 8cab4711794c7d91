"""Body models on other meshes: they make the body they came from, and fit other people."""

from types import SimpleNamespace

import numpy as np
import pytest
from open_bodies import model_with
from scanned_people import foreign_bodies, settings_with

import riemhuman as rh
from riemhuman.registration import ScanRegistration
from riemhuman.topologies import transfer_model


@pytest.fixture(scope="module")
def people(model):
    """Return two people, in two poses each, whom the model cannot make, and their triangles."""
    return foreign_bodies(model, 31, 2, 2)[:2]


@pytest.fixture(scope="module")
def transferred(model, people):
    bodies, faces = people
    few = settings_with(poses=("t",), tries_arms=False)
    solve = ScanRegistration(model, up="y", settings=few).solve
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ScanRegistration, "solve", lambda self, scan: solve(scan))
        return transfer_model(model, rh.Template(bodies[0, 0], faces))


@pytest.mark.slow
def test_bodies_of_the_other_mesh_are_fitted(transferred, people):
    """The body itself closely, its other pose by skinning, another person by the shape space."""
    bodies, _ = people
    itself, other_pose, other_person = transferred.fit(bodies.reshape(4, -1, 3)[:3]).mean_distance
    assert itself < 0.001
    assert other_pose < 0.006
    assert other_person < 0.012


def test_pose_and_hand_directions_are_transferred(model, bending, monkeypatch):
    """A model with them, transferred to a posed body of its own mesh, makes the same body.

    Its joints are where those of the model are, with the person's build.
    """
    motion = rh.datasets.load_open_motions("coarse", sequences=["jumping_jacks"])[0]
    pose, betas = motion.pose_vectors[len(motion) // 4], np.linspace(-1.0, 1.0, model.n_betas)
    hands = np.linspace(0.0, 0.7, model.hand_directions.shape[-1])
    kept = {"hand_directions": model.hand_directions, "hand_poses": model.hand_poses}
    source = model_with(bending, **kept)
    points = source(betas, pose, hands=hands)
    registered = SimpleNamespace(
        fit=SimpleNamespace(betas=betas, pose=pose, trans=np.zeros(3), hands=hands),
        trusted=True,
        points=points,
        correspondence=rh.surfaces.nearest_points(points, points, model.faces)[0],
    )
    monkeypatch.setattr(ScanRegistration, "solve", lambda *options: registered)
    again = transfer_model(source, rh.Template(points, model.faces))
    np.testing.assert_allclose(again.posedirs, bending.posedirs, atol=1e-12)
    np.testing.assert_allclose(again(betas, pose, hands=hands), points, atol=1e-9)
    np.testing.assert_allclose(again.joints(), source.joints(), atol=1e-9)
    assert again.joint_names == model.joint_names


def test_bodies_to_which_the_model_cannot_be_registered_are_refused(model, monkeypatch):
    untrusted = SimpleNamespace(fit=None, trusted=False, message="the shape is far from all people")
    monkeypatch.setattr(ScanRegistration, "solve", lambda *options: untrusted)
    with pytest.raises(rh.errors.ArgumentError, match="body must be .* found that the shape"):
        transfer_model(model, model.template)
