"""Intrinsic and extrinsic codes of point clouds, after Aumentado-Armstrong et al."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import ModuleType

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.arrays import Array, Integers, Triangles
from riemhuman.errors import DegenerateSurfaceError
from riemhuman.io.mesh_arrays import check_mesh
from riemhuman.learned._codes import PairedCodes
from riemhuman.learned._networks import (
    NetworkSizes,
    cloud_features,
    cloud_shapes,
    network,
    shapes_of_networks,
)
from riemhuman.learned._weight_files import Weights
from riemhuman.surfaces.measures import triangle_areas

# Number of clouds of a body whose codes are averaged, and the seed of their points.
_N_CLOUDS, _SEED_OF_POINTS = 4, 0


@dataclass(frozen=True)
class CloudSizes:
    """Numbers of entries of both codes, of points and eigenvalues, and sizes of hidden layers."""

    n_intrinsic: int = 10
    n_extrinsic: int = 24
    n_points: int = 300
    n_eigenvalues: int = 16
    n_hidden: int = 48
    n_features: int = 256

    def networks(self) -> dict[str, NetworkSizes]:
        """Return the sizes of the networks after the features of a cloud, by name."""
        n_codes, n_hidden = self.n_intrinsic + self.n_extrinsic, 2 * self.n_hidden
        return {
            "codes": NetworkSizes(self.n_features, n_hidden, n_codes),
            "points": NetworkSizes(n_codes, n_hidden, 3 * self.n_points),
            "spectrum": NetworkSizes(self.n_intrinsic, n_hidden, self.n_eigenvalues),
        }


def encoded(parameters: Mapping[str, Array], clouds: Array, backend: ModuleType = np) -> Array:
    """Return both codes of clouds of points, (n, n_points, 3), one after the other."""
    return network(parameters, "codes", cloud_features(parameters, clouds, backend), backend)


class IntrinsicExtrinsicCodes(PairedCodes):
    r"""Two codes of a point cloud: one of what bending does not change, and one of the rest.

    It follows the geometrically disentangled autoencoder of Aumentado-Armstrong et al. [1]_
    (GDVAE). Training needs no labels, and codes need no registered mesh: the network reads points
    spread over a surface. It predicts the spectrum of the Laplace–Beltrami operator, which bending
    does not change, from the intrinsic code alone, and the positions of points of the template from
    both codes. Unlike in [1]_, bodies must be upright and face forward, the noise on codes has a
    fixed size, and the decoder gives points in correspondence.

    On scans of real people, expect about 15 % of nearest neighbours to be the same person and 85 to
    90 % the same pose: as in the paper's table, it distinguishes poses, but hardly people.

    Parameters
    ----------
    path : path_like
        The file of a trained network; `load_pretrained` returns the bundled one.

    Attributes
    ----------
    n_intrinsic, n_extrinsic, n_points, n_eigenvalues : int
        Numbers of entries of the codes, points of a cloud, and eigenvalues.
    parameters_ : dict of str to array
        Parameters of the networks.
    vertices_ : array of int, shape (n_points,)
        Vertices of the training template that `inverse_transform` returns.

    References
    ----------
    .. [1] Aumentado-Armstrong, Tsogkas, Jepson, Dickinson, "Geometric disentanglement for
       generative latent shape models", ICCV 2019.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> codes = rh.learned.IntrinsicExtrinsicCodes.load_pretrained(bodies.template)
    >>> intrinsic, extrinsic = codes.split(codes.transform(bodies.points[:2]))
    >>> intrinsic.shape, extrinsic.shape
    ((2, 10), (2, 24))
    """

    n_intrinsic: int
    n_extrinsic: int
    n_points: int
    n_eigenvalues: int
    n_features: int
    vertices_: Integers

    code_names = ("intrinsic", "extrinsic")
    _SETTINGS = ("n_intrinsic", "n_extrinsic", "n_points", "n_eigenvalues", "n_features")
    _SHIPPED = "intrinsic_extrinsic_codes.npz"

    def transform(self, X: ArrayLike) -> Array:
        points = self._check_points(X)
        codes = [self.describe(surface, self.template_.faces) for surface in points]
        return np.array(codes).reshape(len(points), sum(self._n_codes))

    def describe(self, vertices: ArrayLike, faces: ArrayLike) -> Array:
        """Return the codes of any mesh.

        Parameters
        ----------
        vertices : array_like, shape (V, 3)
            Vertex positions, in metres, y up, the body facing +z.
        faces : array_like, shape (F, 3)
            Vertex indices of each triangle, counted from 0.
        """
        points, triangles = check_mesh(vertices, faces)
        self._check_scale(points, "vertices")
        rng = np.random.default_rng(_SEED_OF_POINTS)
        clouds = [surface_points(points, triangles, self.n_points, rng) for _ in range(_N_CLOUDS)]
        codes = encoded(self.parameters_, np.stack(clouds))
        return np.asarray(codes.mean(axis=0))

    def inverse_transform(self, Z: ArrayLike) -> Array:
        codes = self._check_codes(Z)
        points = network(self.parameters_, "points", codes)
        return points.reshape(len(codes), self.n_points, 3) + self._place

    def spectra(self, Z: ArrayLike) -> Array:
        """Return the eigenvalues that the network predicts from intrinsic codes, in 1 / metre².

        Parameters
        ----------
        Z : array_like, shape (n, n_intrinsic + n_extrinsic)
            Codes; the extrinsic ones have no effect.
        """
        intrinsic, _ = self.split(Z)
        return np.exp(network(self.parameters_, "spectrum", intrinsic) + self._spectrum)

    @property
    def _n_codes(self) -> tuple[int, int]:
        return self.n_intrinsic, self.n_extrinsic

    def _read(self, weights: Weights) -> None:
        self.n_intrinsic = weights.settings["n_intrinsic"]
        self.n_extrinsic = weights.settings["n_extrinsic"]
        self.n_points = weights.settings["n_points"]
        self.n_eigenvalues = weights.settings["n_eigenvalues"]
        self.n_features = weights.settings["n_features"]
        n_vertices = weights.template.n_vertices
        self.vertices_ = weights.indices("vertices", (self.n_points,), 0, n_vertices)
        self._place = weights.numbers("place", (self.n_points, 3))
        self._spectrum = weights.numbers("mean_spectrum", (self.n_eigenvalues,))
        sizes = CloudSizes(
            self.n_intrinsic,
            self.n_extrinsic,
            self.n_points,
            self.n_eigenvalues,
            self.n_hidden,
            self.n_features,
        )
        self.parameters_ = weights.arrays(
            cloud_shapes(self.n_hidden, self.n_features) | shapes_of_networks(sizes.networks())
        )


def surface_points(
    vertices: Array, faces: Triangles, n_points: int, rng: np.random.Generator
) -> Array:
    """Return random points spread evenly over a surface, one in each stretch of equal area."""
    ends = np.cumsum(triangle_areas(vertices, faces))
    if not len(ends) or not ends[-1] > 0:
        raise DegenerateSurfaceError("the surface has no area; points cannot be spread over it")
    places = (np.arange(n_points) + rng.random(n_points)) * (ends[-1] / n_points)
    triangles = np.minimum(np.searchsorted(ends, places), len(ends) - 1)
    # By the square root, distances from the first corner are as frequent as the area grows.
    root, share = np.sqrt(rng.random(n_points)), rng.random(n_points)
    barycentric = np.stack([1.0 - root, root * (1.0 - share), root * share], axis=1)
    points = np.einsum("pc,pcx->px", barycentric, vertices[faces[triangles]])
    centred: Array = points - points.mean(axis=0)
    return centred
