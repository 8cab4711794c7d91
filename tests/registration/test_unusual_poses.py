"""People who jump, kick, kneel, sit on the floor, crawl or lie are found without a hint."""

import numpy as np
import pytest

from riemhuman.datasets import joint_rotations, pose_vectors
from riemhuman.datasets.open_bodies import surface_noise
from riemhuman.registration import simulated_scan

POSES = {
    "jump": {"hip": ["x", -15], "knee": ["x", 115], "shoulder": ["z", 25]},
    "kick": {"left_hip": ["x", -105], "shoulder": ["z", -25], "elbow": ["y", -40]},
    "side kick": {"right_hip": ["z", -80], "elbow": ["y", -90], "shoulder": ["z", -60]},
    "kneel": {"hip": ["x", -8], "knee": ["x", 95], "shoulder": ["z", -70]},
    "sit on heels": {"hip": ["x", -80], "knee": ["x", 145], "shoulder": ["xz", -30, -70]},
    "half kneel": {"left_hip": ["x", -90], "knee": ["x", 90], "shoulder": ["z", -70]},
    "sit on the floor": {"hip": ["xz", -95, 8], "knee": ["x", 12], "shoulder": ["z", -60]},
    "cross-legged": {"hip": ["yxy", 60, -80, 30], "knee": ["x", 115], "shoulder": ["z", -60]},
    "crawl": {
        "pelvis": ["x", 85],
        "hip": ["x", -85],
        "knee": ["x", 90],
        "shoulder": ["y", -85],
        "neck": ["x", -30],
    },
    "lie on the back": {"pelvis": ["x", -90], "shoulder": ["z", -60], "hip": ["z", 10]},
    "lie on the front": {"pelvis": ["x", 90], "shoulder": ["z", -50], "hip": ["z", 8]},
    "lie on a side": {
        "pelvis": ["z", 90],
        "hip": ["x", -40],
        "knee": ["x", 50],
        "shoulder": ["y", -60],
    },
}


def someone(name, model, rng):
    """Return a body whose joints differ from those of a pose, with details of its own."""
    vectors = pose_vectors(joint_rotations(POSES[name], model)[None], model)[0]
    joints = [joint.split("_")[-1] for joint in model.joint_names]
    limbs = np.isin(joints, ["shoulder", "elbow", "hip", "knee"])
    degrees = np.where(limbs, 10.0, 4.0) * (model.parents >= 0)
    vectors = vectors + np.radians(degrees)[:, np.newaxis] * rng.standard_normal(vectors.shape)
    betas = np.zeros(model.n_betas)
    betas[:10] = np.clip(rng.standard_normal(10), -2.0, 2.0)
    return model(betas, vectors) + surface_noise(model.template.vertices, 0.0015, (0.1, 0.4), rng)


@pytest.mark.everyday("lie on the back")
@pytest.mark.parametrize("name", POSES)
def test_unusual_poses_are_found(registration, model, name):
    rng = np.random.default_rng([31, list(POSES).index(name)])
    body = someone(name, model, rng)
    scan = simulated_scan(body, model.faces, rng, n_points=6000, missing=0.05)
    result = registration.solve(scan.points)
    assert result.trusted, result.message
    assert result.trusted_vertices.mean() > 0.85
    assert np.linalg.norm(result.points - scan.body, axis=1).mean() < 0.015
