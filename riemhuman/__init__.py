"""Riemannian shape analysis of human bodies.

A body registered to a template mesh T is a map f: T → R³. It is represented by its first
fundamental form g and its unit normals n, Φ(f) = (g, n). Distances of these fields have a closed
form; geodesics and means are found under the metrics pulled back by Φ. See Pierson, Daoudi and
Tumpach, "A Riemannian Framework for Analysis of Human Body Surface", WACV 2022.

Examples in docstrings assume ``import numpy as np`` and ``import riemhuman as rh``.
"""

from __future__ import annotations

from importlib import import_module

import lazy_loader

from riemhuman.provided import default_solvers, notebook_pictures
from riemhuman.provided import topologies as later_topologies

__version__ = "0.1.0"

# The names of __init__.pyi, each loaded on first use.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

default_solvers.load_by(lambda: import_module("riemhuman.solvers.defaults"))
notebook_pictures.load_by(lambda: import_module("riemhuman.plots"))
later_topologies.load_by(lambda: import_module("riemhuman.topologies"))
