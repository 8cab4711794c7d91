"""Motions as the joint rotations of a body model that is fitted to every frame."""

from __future__ import annotations

import numpy as np
from numpy import ndarray
from scipy.spatial.transform import Rotation

from riemhuman.bodies import BodyModel
from riemhuman.geometry import FlatMetric, VectorSpace
from riemhuman.motions.frames import Motion, frame_runs


class JointAngles:
    """Joint rotations of fitted models, with the metric of the space of matrices.

    Parameters
    ----------
    model : BodyModel
        Model over the template of the motions.

    Attributes
    ----------
    metric : FlatMetric
        Half the sum over joints of squared distances of matrices, which for small angles is nearly
        the sum of squared angles. For use with `DynamicTimeWarping`.

    Examples
    --------
    >>> import riemhuman as rh
    >>> knees = rh.datasets.load_open_motions("coarse", sequences="knees")[0]
    >>> angles = rh.motions.JointAngles(knees.model)
    >>> angles.rotations(knees[:2]).shape == (2, knees.model.n_joints, 9)
    True
    """

    metric: FlatMetric

    def __init__(self, model: BodyModel) -> None:
        self._model = model
        space = VectorSpace((model.n_joints, 9), equip=False)
        self.metric = FlatMetric(space, weights=np.full(model.n_joints, 0.5))

    def rotations(self, motion: Motion, name: str = "motion") -> ndarray:
        """Return the rotation matrices of all joints in every frame.

        Parameters
        ----------
        motion : array or sequence, shape (n_frames, V, 3)
            The motion.
        name : str
            Name of the motion, for messages.

        Returns
        -------
        array, shape (n_frames, J, 9)

        Raises
        ------
        ArgumentError
            If a frame is wrong.
        """
        space = VectorSpace((self._model.n_vertices, 3))
        poses = [self._model.fit(run).pose for run in frame_runs(space, motion, name)]
        pose = np.concatenate(poses).reshape(-1, self._model.n_joints, 3)
        matrices = Rotation.from_rotvec(pose.reshape(-1, 3)).as_matrix()
        return matrices.reshape(*pose.shape[:2], 9)
