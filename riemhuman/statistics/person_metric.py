"""A metric that tells people apart in any pose, learned from simulated people."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

import autograd.numpy as np
import numpy as onp

from riemhuman.arrays import Array, Points, Triangles
from riemhuman.datasets import load_open_model
from riemhuman.errors import ArgumentError
from riemhuman.geometry import AreaMetric, PullbackMetric
from riemhuman.geometry.manifold import SurfaceSpace, surface_space
from riemhuman.geometry.pairwise import Bulk, Factor, SumOfFactors
from riemhuman.geometry.strategies import Solvers
from riemhuman.io.arrays import load_arrays
from riemhuman.surfaces import SurfacePoints, Template

if TYPE_CHECKING:
    from riemhuman.topologies import TopologyMap

WEIGHTS = Path(__file__).parent / "data" / "person_metric.npz"


class PersonMetric(PullbackMetric):
    r"""`AreaMetric`, with the changes that poses make counted less: the answer to "who is it?".

    Let x be the smoothed logarithms of area ratios that `AreaMetric` compares. How x varies over
    poses of one person was learned from 300 simulated bodies, the natural bodies of thirty people
    whom no data set includes. Its 20 principal directions :math:`u_k`, with variances
    :math:`\lambda_k`, count less by

    .. math:: w_k^2 = \frac{\epsilon}{\lambda_k + \epsilon}, \qquad
              \epsilon = 0.003\, \lambda_1, \qquad
              y = x - \sum_k (1 - w_k) \langle u_k, x \rangle u_k,

    and the distance is that of y, as in linear discriminant analysis. Rank and ε were chosen on
    other simulated people. No labels of the people who are compared are needed; where there are
    labels of others, `rh.LearnedMetric` with ``AreaMetric(space)`` learns from real poses.

    Parameters
    ----------
    space : AlignedSurfaces
    topology : TopologyMap, optional
        Where the vertices of `space` lie on the open body model, for surfaces with other triangles:
        `rh.topologies.TopologyMap.fit` finds it from any of them, in seconds. Surfaces from
        registration have the model's triangles, in either resolution, and need none.
    **solvers : strategies, see `RiemannianMetric`

    Notes
    -----
    Like those of `AreaMetric`, fields are vectors in a flat space, so distances have a closed form;
    geodesics and means of surfaces need another metric.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse", "natural")
    >>> person = rh.PersonMetric(rh.AlignedSurfaces(bodies.template))
    >>> rh.retrieval.scores(person.dist_pairwise(bodies.points), bodies.subject).first_tier
    100.0
    """

    space: SurfaceSpace
    is_translation_invariant = True
    is_rotation_invariant = True

    def __init__(
        self,
        space: SurfaceSpace,
        topology: TopologyMap | None = None,
        **solvers: Unpack[Solvers],
    ) -> None:
        space = surface_space(space)
        self._areas = AreaMetric(space)
        masses = space.template.vertex_heat.masses
        fields, weights = fields_of_poses()
        carried = _carried(fields, space.template, topology)
        roots = onp.sqrt(masses)[:, onp.newaxis]
        # On other templates, the directions are no longer quite orthonormal.
        scaled = carried * roots
        directions = onp.linalg.solve(onp.linalg.cholesky(scaled.T @ scaled), carried.T).T
        self._removed = directions * (1.0 - weights)
        self._measured = directions * masses[:, onp.newaxis]
        super().__init__(space, self._areas.target_metric, self.person_fields, **solvers)

    def person_fields(self, f: Points) -> Array:
        """Return the fields y that are compared, shape (..., V).

        Parameters
        ----------
        f : array, shape (..., V, 3)
        """
        return self._without_poses(self._areas.log_areas(f))

    @property
    def bulk(self) -> Bulk:
        def fields(points: Points) -> Array:
            return self._without_poses(self._areas.compiled_log_areas(points))

        return SumOfFactors([Factor(fields, 1.0, self.target_metric.bulk)])

    def _without_poses(self, fields: Array) -> Array:
        return fields - np.dot(np.dot(fields, self._measured), self._removed.T)

    def lower_bound_coordinates(self, points: Points) -> Array:
        return np.sqrt(self.space.template.vertex_heat.masses) * self.person_fields(points)


@cache
def fields_of_poses() -> tuple[Array, Array]:
    """Return directions over the coarse open template, shape (V, K), and their weights, (K,)."""
    # See tutorials/remake/build_person_metric.py.
    arrays = load_arrays(WEIGHTS, ["fields", "weights"])
    return arrays["fields"].astype(float), arrays["weights"].astype(float)


@cache
def _places_on_coarse_body() -> SurfacePoints:
    """Return where the vertices of the full open template lie on the coarse one."""
    # Stored: to compile the search for them takes a tenth of a first `riemhuman tables`.
    arrays = load_arrays(WEIGHTS, ["triangles", "barycentric"])
    return SurfacePoints(arrays["triangles"], arrays["barycentric"])


def _carried(fields: Array, template: Template, topology: TopologyMap | None) -> Array:
    """Return fields over the coarse open template, carried to another template."""
    if topology is None:
        return _over_model(
            fields,
            template,
            "space",
            "; give topology=rh.topologies.TopologyMap.fit(space.template)",
        )
    if not onp.array_equal(template.faces, topology.template_faces):
        raise ArgumentError("topology must be a map of the triangles of space; found others")
    model = topology.model.template
    return _at(topology.template_places.places, _over_model(fields, model, "topology"), model.faces)


def _over_model(fields: Array, template: Template, name: str, advice: str = "") -> Array:
    """Return fields over the coarse open template at either resolution of the open model."""
    coarse = load_open_model("coarse").template
    if onp.array_equal(template.faces, coarse.faces):
        return fields
    full = load_open_model("full").template
    if not onp.array_equal(template.faces, full.faces):
        raise ArgumentError(
            f"{name} must have the open body model's triangles, as registered scans do; found "
            f"{template.n_faces} other triangles{advice}"
        )
    return _at(_places_on_coarse_body(), fields, coarse.faces)


def _at(places: SurfacePoints, fields: Array, faces: Triangles) -> Array:
    """Return fields over the vertices of a mesh, interpolated at places on it."""
    interpolated: Array = onp.einsum(
        "vc,vck->vk", places.barycentric, fields[faces[places.triangles]]
    )
    return interpolated
