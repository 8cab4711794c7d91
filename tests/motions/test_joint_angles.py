"""Joint rotations of fitted models are those the motions were made with."""

import numpy as np
from scipy.spatial.transform import Rotation

import riemhuman as rh


def test_rotations_of_an_open_motion(open_motions):
    motion = open_motions[0]
    joints = rh.motions.JointAngles(motion.model)
    frames = [0, 20]
    found = joints.rotations(motion[:21:20])
    poses = motion.pose_vectors[frames]
    expected = Rotation.from_rotvec(poses.reshape(-1, 3)).as_matrix().reshape(found.shape)
    angles = joints.metric.dist(found, expected)
    assert (angles < 0.2 * joints.metric.dist(found[0], found[1])).all()
    warping = rh.motions.DynamicTimeWarping(joints.metric)
    assert warping.dist(found, np.repeat(found, 2, axis=0)) == 0.0
