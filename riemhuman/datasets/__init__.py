"""Registered bodies to compute with: the open set that ships, and readers for others."""

from riemhuman.datasets.bodies import Bodies
from riemhuman.datasets.dfaust import load_dfaust
from riemhuman.datasets.faust import load_faust
from riemhuman.datasets.motions import Motion
from riemhuman.datasets.open_bodies import load_open_bodies, load_open_model
from riemhuman.datasets.open_motions import load_open_motions

__all__ = [
    "Bodies",
    "Motion",
    "load_dfaust",
    "load_faust",
    "load_open_bodies",
    "load_open_model",
    "load_open_motions",
]
