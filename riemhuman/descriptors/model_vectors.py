"""Shape and pose vectors of registered surfaces, from the fit of a body model."""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation
from tqdm import tqdm

from riemhuman.arrays import Array
from riemhuman.checks import checked, choice, flag, having, real_array
from riemhuman.descriptors.descriptor import Descriptor, Surfaces, meshes_of, pairwise

if TYPE_CHECKING:
    from riemhuman.bodies import BodyModel
    from riemhuman.bodies.fitting import ModelFit


@checked(model=having("a body model with a method fit", "fit"))
@dataclass(frozen=True, eq=False)
class _ModelVectors(Descriptor):
    model: BodyModel

    def describe(self, vertices: ArrayLike, faces: ArrayLike) -> Array:
        points = self._check_points(vertices, faces)
        vector: Array = self._vectors(self.model.fit(points[np.newaxis]))[0]
        return vector

    def describe_all(self, bodies: Surfaces, n_jobs: int | None = None) -> Array:
        """Return the vectors of surfaces of the model's mesh, fitted together in one batch."""
        return self._vectors(self._fit(bodies))

    @staticmethod
    @checked(progress=flag)
    def describe_together(
        descriptors: Sequence[_ModelVectors],
        bodies: Surfaces,
        *,
        progress: bool = False,
    ) -> tuple[list[Array], list[float]]:
        """Return vectors and seconds of several descriptors; each model is fitted once."""
        fits = {}
        models = {id(descriptor.model): descriptor for descriptor in descriptors}
        for key, descriptor in tqdm(models.items(), disable=not progress, unit="fit"):
            began = time.perf_counter()
            fits[key] = descriptor._fit(bodies), time.perf_counter() - began
        vectors, seconds = [], []
        for descriptor in descriptors:
            fit, shared = fits[id(descriptor.model)]
            began = time.perf_counter()
            vectors.append(descriptor._vectors(fit))
            seconds.append(shared + time.perf_counter() - began)
        return vectors, seconds

    def _fit(self, bodies: Surfaces) -> ModelFit:
        count, mesh = meshes_of(bodies)
        points = np.stack([self._check_points(*mesh(i), f" of body {i}") for i in range(count)])
        return self.model.fit(points)

    def _check_points(self, vertices: ArrayLike, faces: ArrayLike, where: str = "") -> Array:
        name, template = f"vertices{where}", self.model.template
        points = real_array(vertices, name, ("n_vertices", 3), batched=False)
        template.check_faces(faces, f"faces{where}")
        checked: Array = template.check_points(points, name)
        return checked

    @abstractmethod
    def _vectors(self, fit: ModelFit) -> Array:
        """Return the vector of each surface of a fit, shape (n, d)."""


@checked()
@dataclass(frozen=True, eq=False)
class ModelShapeVectors(_ModelVectors):
    """The shape coefficients of a body model fitted to registered surfaces.

    With an SMPL model, these are the paper's SMPL shape vectors. The distance is Euclidean.

    Parameters
    ----------
    model : BodyModel
        Model that the surfaces are registered to.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.descriptors.ModelShapeVectors(bodies.model).describe_all(bodies[:2]).shape
    (2, 32)
    """

    def _vectors(self, fit: ModelFit) -> Array:
        return np.asarray(fit.betas, dtype=np.float64)


@checked(distance=choice("axis-angle", "rotation"), root=flag)
@dataclass(frozen=True, eq=False)
class ModelPoseVectors(_ModelVectors):
    """The joint rotations of a body model fitted to registered surfaces.

    With an SMPL model, these are the paper's SMPL pose vectors.

    Parameters
    ----------
    model : BodyModel
        Model to which the surfaces are registered.
    distance : {"axis-angle", "rotation"}
        The Euclidean distance of axis-angle vectors, or the sum over joints of the angles between
        the rotations, which is continuous where axis-angle vectors jump, at half a turn.
    root : bool
        Whether to include the rotation of joints without a parent: the orientation of the body.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.descriptors.ModelPoseVectors(bodies.model).describe_all(bodies[:2]).shape[0]
    2
    """

    distance: str = "axis-angle"
    root: bool = True

    def distances(self, vectors: ArrayLike) -> Array:
        if self.distance == "axis-angle":
            return pairwise(vectors, "euclidean")
        rows = real_array(vectors, "vectors", ("n_vectors", "3 n_joints"), batched=False)
        n_joints = rows.shape[1] // 3
        quaternions = Rotation.from_rotvec(rows.reshape(-1, 3)).as_quat()
        quaternions = quaternions.reshape(len(rows), n_joints, 4)
        total = np.zeros((len(rows), len(rows)))
        for joint in np.swapaxes(quaternions, 0, 1):
            # Angle of unit quaternions, with the nearer of ±q: atan2 is accurate for small angles.
            gaps = np.linalg.norm(joint[:, np.newaxis] - joint, axis=-1)
            sums = np.linalg.norm(joint[:, np.newaxis] + joint, axis=-1)
            total += 4 * np.arctan2(np.minimum(gaps, sums), np.maximum(gaps, sums))
        return total

    def _vectors(self, fit: ModelFit) -> Array:
        pose = np.asarray(fit.pose, dtype=np.float64)
        if not self.root:
            pose = pose[:, np.asarray(self.model.parents) >= 0]
        return pose.reshape(len(pose), -1)
