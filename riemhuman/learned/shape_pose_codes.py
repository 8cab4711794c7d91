"""Shape and pose codes, after Zhou, Bhatnagar and Pons-Moll."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from riemhuman.arrays import Array, Integers
from riemhuman.errors import ArgumentError
from riemhuman.learned._codes import PairedCodes
from riemhuman.learned._networks import NetworkSizes, network, shapes_of_networks
from riemhuman.learned._parts import Parts
from riemhuman.learned._weight_files import Weights
from riemhuman.surfaces import Template

# Largest distance of matching vertices, relative to the size of the template: files round.
_SAME = 1e-5


@dataclass(frozen=True)
class ShapePoseSizes:
    """Numbers of entries of both codes, of parts of the body, and of hidden units in a layer."""

    n_shape: int = 16
    n_pose: int = 64
    n_parts: int = 96
    n_hidden: int = 192

    def networks(self) -> dict[str, NetworkSizes]:
        """Return the sizes of the networks by name."""
        n_rotations, n_codes = 3 * self.n_parts, self.n_shape + self.n_pose
        return {
            "shape": NetworkSizes(2 * n_rotations, self.n_hidden, self.n_shape),
            "pose": NetworkSizes(n_rotations, self.n_hidden, self.n_pose),
            "turns": NetworkSizes(n_codes, self.n_hidden, n_rotations),
            "stretches": NetworkSizes(n_codes, self.n_hidden, 2 * n_rotations),
        }


def encoded(
    parameters: Mapping[str, Array], features: Array, n_parts: int, backend: ModuleType = np
) -> tuple[Array, Array]:
    """Return the shape codes and pose codes of normalised features."""
    n_rotations = 3 * n_parts
    shape = network(parameters, "shape", features[:, n_rotations:], backend)
    return shape, network(parameters, "pose", features[:, :n_rotations], backend)


def decoded(parameters: Mapping[str, Array], codes: Array, backend: ModuleType = np) -> Array:
    """Return the normalised features of bodies with these codes."""
    features = [network(parameters, name, codes, backend) for name in ("turns", "stretches")]
    joined: Array = backend.concatenate(features, 1)
    return joined


class ShapePoseCodes(PairedCodes):
    r"""Two codes of a body by an autoencoder: one of the person, and one of the pose.

    It follows Zhou, Bhatnagar and Pons-Moll [1]_: one encoder computes a shape code, another
    computes a pose code, and a decoder reconstructs the body from both. Training (see
    ``tutorials/remake``) uses labels of people, but not of poses. Instead of convolutions on the
    mesh, the shape code depends on the stretches of parts, and the pose code on their rotations
    relative to their neighbours, so the position and orientation of the body have no effect.

    The bundled network was trained only on bodies of the open model. On registrations of real
    people with another template, expect 75 to 80 % of nearest neighbours to be the same person, 90
    % the same pose, and reconstructions that are 45 to 100 mm off; metrics do better there.

    Parameters
    ----------
    path : path_like
        The file of a trained network; `load_pretrained` returns the bundled one.

    Attributes
    ----------
    n_shape, n_pose : int
        Numbers of entries of the codes.
    parameters_ : dict of str to array
        Parameters of the networks.

    References
    ----------
    .. [1] Zhou, Bhatnagar, Pons-Moll, "Unsupervised shape and pose disentanglement for 3D meshes",
       ECCV 2020.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> codes = rh.learned.ShapePoseCodes.load_pretrained(bodies.template)
    >>> both = codes.transform(bodies.points[:2])
    >>> shape, pose = codes.split(both)
    >>> shape.shape, pose.shape, codes.inverse_transform(both).shape
    ((2, 16), (2, 64), (2, 1202, 3))
    """

    n_shape: int
    n_pose: int
    n_parts: int
    _parts: Parts
    _vertices: Integers  # of the template that are the network's

    code_names = ("shape", "pose")
    _SETTINGS = ("n_shape", "n_pose", "n_parts")
    _SHIPPED = "shape_pose_codes.npz"

    def on(self, template: Template) -> Self:
        codes = super().on(template)
        codes._vertices = _same_vertices(self._home, template)
        return codes

    def transform(self, X: ArrayLike) -> Array:
        points = self._check_points(X)[:, self._vertices]
        if len(points):
            self._check_scale(points, "X")
        features, _ = self._parts.split(points)
        features = (features - self._center) / self._scale
        return np.concatenate(encoded(self.parameters_, features, self.n_parts), axis=1)

    def inverse_transform(self, Z: ArrayLike) -> Array:
        codes = self._check_codes(Z)
        features = decoded(self.parameters_, codes) * self._scale + self._center
        return self._parts.surfaces(features)

    def transfer(self, X: ArrayLike, poses: ArrayLike) -> Array:
        """Return people in the poses of other bodies.

        Parameters
        ----------
        X, poses : array_like, shape (n, V, 3)
            Bodies that give the shapes and the poses, metres.
        """
        of_people, of_poses = self.transform(X), self.transform(poses)
        if len(of_people) != len(of_poses):
            raise ArgumentError(
                f"X and poses must have the same length; found {len(of_people)} and {len(of_poses)}"
            )
        mixed = [self.split(of_people)[0], self.split(of_poses)[1]]
        return self.inverse_transform(np.concatenate(mixed, axis=1))

    @property
    def _n_codes(self) -> tuple[int, int]:
        return self.n_shape, self.n_pose

    def _read(self, weights: Weights) -> None:
        self.n_shape = weights.settings["n_shape"]
        self.n_pose = weights.settings["n_pose"]
        self.n_parts = weights.settings["n_parts"]
        sizes = ShapePoseSizes(self.n_shape, self.n_pose, self.n_parts, self.n_hidden)
        self._vertices = np.arange(weights.template.n_vertices)
        self._parts = Parts.read(weights, self.n_parts)
        self._center = weights.numbers("center", (9 * self.n_parts,))
        self._scale = weights.numbers("scale", (9 * self.n_parts,), positive=True)
        self.parameters_ = weights.arrays(shapes_of_networks(sizes.networks()))


def _same_vertices(home: Template, template: Template) -> Integers:
    """Return the vertices of a template that are those of the network's."""
    if np.array_equal(home.faces, template.faces):
        return np.arange(home.n_vertices)
    gaps, numbers = cKDTree(template.vertices).query(home.vertices)
    if gaps.max() > _SAME * np.ptp(home.vertices, axis=0).max():
        raise ArgumentError(
            "template must have the vertices of the network's template; one of these is "
            f"{gaps.max():.3g} from the nearest. Bring bodies to the open model first, by "
            "riemhuman.topologies.TopologyMap"
        )
    return np.asarray(numbers)
