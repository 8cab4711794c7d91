"""Registration of scans by a template, from a rough start."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from riemhuman.arrays import Array, ArrayLike
from riemhuman.checks import checked, instance, real_array
from riemhuman.errors import ArgumentError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.kernels.surface import vertex_normals
from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.registration._elastic_step import fit_elastic
from riemhuman.registration._scan_preparation import PreparedScan, prepare_scan
from riemhuman.registration._shown_parts import find_seen
from riemhuman.registration.registered_scans import RegisteredScan
from riemhuman.registration.scans import Scan, as_scan
from riemhuman.surfaces.nearest_points import nearest_points
from riemhuman.surfaces.procrustes import procrustes
from riemhuman.surfaces.template import Template

# Templates are scaled to the size of a body, for which all lengths below were chosen.
_SIZE = 2.0
_RIGID_SCALES = (0.4, 0.2, 0.2, 0.1, 0.1, 0.06, 0.06, 0.04)
_FREE_SCALES = (0.1, 0.06, 0.03, 0.015)
_STIFFNESSES = (3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4)
_NEAR_METRES = 0.02
# A registration is not trusted if a smaller share of the template, or of the scan, is matched.
_LEAST_MATCHED, _LEAST_NEAR = 0.3, 0.8


@checked(template=instance(Template))
@dataclass(frozen=True)
class TemplateRegistration:
    """Registers scans by a template from a rough start: first rigidly, then elastically.

    Minimises Σ_i w_i ((n_i·r_i)² + τ ‖r_i‖²) + α d²(f, f₀) over the surfaces f, with the gaps r to
    the closest points of the scan, its normals n, and the elastic distance d with (a, λ, c) =
    (1, 1, 1) from the rigidly aligned template f₀. The stiffness α falls.

    Parameters
    ----------
    template : Template
        The template, at the size of the scans.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> registration = rh.registration.TemplateRegistration(bodies.template)
    >>> scan = rh.registration.simulated_scan(bodies[0], bodies.template.faces, 0, rotate=False)
    >>> registration.solve(scan.points, start=bodies[1]).points.shape
    (1202, 3)
    """

    template: Template

    def __post_init__(self) -> None:
        template = self.template
        if template.seams:
            raise ArgumentError(
                f"template has {template.seams.n_copies} duplicated vertices along seams, where "
                "it would tear; join them with template.join_seams()"
            )

    def solve(self, scan: object, *, start: ArrayLike | None = None) -> RegisteredScan:
        """Register a scan, without a likelihood and a fit in the result.

        Parameters
        ----------
        scan : path, Scan, array_like or pair
            As for `ScanRegistration.solve`.
        start : array_like, shape (V, 3), optional
            The template roughly in the position of the scan; by default its own vertices.
        """
        template = self.template
        whole = as_scan(scan, "metres")  # which leaves any unit as it is
        if start is None:
            points = template.vertices
        else:
            shape = (template.n_vertices, 3)
            points = real_array(start, "start", shape, batched=False)
        scaled = replace(whole, points=whole.points * self._factor)
        prepared = prepare_scan(scaled, surroundings=False)
        with single_threaded_libraries():
            return self._fit(whole, prepared, points * self._factor)

    @cached_property
    def _factor(self) -> float:
        """The factor that scales the template to the size of a body."""
        return _SIZE / float(np.linalg.norm(np.ptp(self.template.vertices, axis=0)))

    @cached_property
    def _metric(self) -> ElasticMetric:
        scaled = Template(self.template.vertices * self._factor, self.template.faces)
        return ElasticMetric(AlignedSurfaces(scaled), a=1.0, lam=1.0, c=1.0)

    def _fit(self, whole: Scan, prepared: PreparedScan, points: Array) -> RegisteredScan:
        faces = self.template.faces
        for scale in _RIGID_SCALES:
            matches = prepared.match(points, vertex_normals(points, faces), scale)
            weights = matches.weights * self.template.vertex_areas
            if not weights.any():
                raise ArgumentError("no part of start faces the same way as the nearby scan")
            points = procrustes(points, to=points + matches.gaps, scale=None, weights=weights)
        reference = points
        for scale in _FREE_SCALES:
            points, matches = fit_elastic(
                self._metric, points, reference, prepared, _STIFFNESSES, scale
            )
        near = matches.distances < _NEAR_METRES
        matched = near & (matches.reliable > 0.1)
        seen = find_seen(self._metric.space.template, points, matched, prepared)
        points = points / self._factor
        places, distances = nearest_points(whole.points, points, faces)
        close = float(np.mean(distances * self._factor < _NEAR_METRES))
        reasons = []
        if matched.mean() < _LEAST_MATCHED:
            reasons.append(f"only {100 * matched.mean():.0f} % of the template matches the scan")
        if close < _LEAST_NEAR:
            reasons.append(f"only {100 * close:.0f} % of the scan lies near the template")
        return RegisteredScan(
            points=points,
            trusted=not reasons,
            trusted_vertices=seen & (not reasons),
            message="; ".join(reasons),
            likelihood=np.nan,
            fit=None,
            distances=distances,
            matched=matched,
            correspondence=places,
            background=np.zeros(len(whole), dtype=bool),
            up=np.array([0.0, 1.0, 0.0]),
            transform=np.eye(4),
            unit=whole.unit,
            faces=faces,
            scan=whole,
        )
