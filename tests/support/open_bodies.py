"""The open bodies, loaded once in a process, and models that differ in a field."""

from functools import cache

import numpy as np

from riemhuman.bodies import BodyModel
from riemhuman.datasets import Bodies, load_open_bodies


@cache
def coarse_bodies() -> Bodies:
    """Return the hundred plain bodies; tests change none of their arrays."""
    return load_open_bodies("coarse")


def model_with(model: BodyModel, **changes: object) -> BodyModel:
    """Return a model some of whose fields are others."""
    same = ("faces", "shapedirs", "joint_regressor", "weights", "posedirs", "joint_names")
    fields = {name: getattr(model, name) for name in (*same, "hand_directions", "hand_poses")}
    fields["v_template"] = model.template.vertices
    fields["kintree_table"] = np.stack([model.parents, np.arange(model.n_joints)])
    return BodyModel(**fields | changes)


def with_pose_directions(model):
    """Return the model with random pose directions and no hands."""
    shape = (model.n_vertices, 3, 9 * (model.n_joints - 1))
    posedirs = 1e-3 * np.random.default_rng(0).standard_normal(shape)
    return model_with(model, posedirs=posedirs, hand_directions=None, hand_poses=())
