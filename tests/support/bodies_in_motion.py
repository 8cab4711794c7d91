"""Bodies of the coarse open model and a basis of its motions, for tests of solvers."""

from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from riemhuman.datasets import load_open_model
from riemhuman.geometry import AlignedSurfaces
from riemhuman.surfaces import DeformationBasis


@cache
def model():
    """Return the coarse open body model."""
    return load_open_model("coarse")


@cache
def space():
    """Return the surfaces over its template."""
    return AlignedSurfaces(model().template, equip=False)


@cache
def basis(n_components=60):
    """Return the principal deformations of seeded swings of all joints of three bodies."""
    if n_components < 60:
        return basis().truncate(n_components)
    rng = np.random.default_rng(11)
    body = model()
    times = np.arange(10)[:, None, None]
    motions = []
    for _ in range(24):
        amplitude = rng.normal(0.0, 0.35, (body.n_joints, 3))
        phase = rng.uniform(0.0, 2 * np.pi, (body.n_joints, 3))
        middle = rng.normal(0.0, 0.15, (body.n_joints, 3))
        poses = middle + amplitude * np.sin(0.8 * times + phase)
        motions.append(body(betas=rng.normal(size=body.n_betas), pose=poses))
    return DeformationBasis.from_motions(motions, n_components=n_components, step=1)


def pose(**degrees):
    """Return a pose vector with these joints turned, each by an axis-angle in degrees."""
    vector = np.zeros((model().n_joints, 3))
    for joint, angles in degrees.items():
        vector[model().joint_names.index(joint)] = np.radians(angles)
    return vector


@cache
def body(name):
    """Return one of a few named bodies."""
    betas = np.random.default_rng(3).normal(size=(5, model().n_betas))
    builds = {"resting": (betas[0], pose()), "other build": (betas[1], pose())}
    moves = {
        "arm raised": pose(left_shoulder=(0, 0, 50), left_elbow=(0, -30, 0)),
        "elbow bent": pose(left_elbow=(0, -120, 0)),
        "knee raised": pose(left_hip=(-80, 0, 0), left_knee=(90, 0, 0)),
    }
    builds |= {move: (betas[0], vector) for move, vector in moves.items()}
    builds |= {f"build {k}": (betas[k], pose()) for k in range(5)}
    shape, vector = builds[name]
    return model()(betas=shape, pose=vector)


def swung_arms(seed):
    """Return a body in two poses whose arms point, twist and bend in seeded, unlike ways."""
    rng = np.random.default_rng(seed)
    betas = rng.normal(size=model().n_betas)
    poses = np.zeros((2, model().n_joints, 3))
    for joints in poses:
        for side, sign in (("left", 1.0), ("right", -1.0)):
            forward, up = rng.uniform((-30.0, -80.0), (120.0, 90.0))
            twist, bend = rng.uniform((-80.0, 0.0), (80.0, 140.0))
            angles = [-sign * forward, sign * up, twist]
            shoulder = Rotation.from_euler("yzx", angles, degrees=True)
            joints[model().joint_names.index(f"{side}_shoulder")] = shoulder.as_rotvec()
            joints[model().joint_names.index(f"{side}_elbow")] = np.radians([0, -sign * bend, 0])
    return model()(betas=betas, pose=poses)
