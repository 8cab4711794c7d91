"""Registration of scans by a body model, without landmarks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from riemhuman.bodies import BodyModel, ModelFit
from riemhuman.checks import one_of, real_array
from riemhuman.datasets.open_bodies import load_open_model
from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
from riemhuman.geometry.elastic_metric import ElasticMetric
from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.progress import ProgressBar
from riemhuman.registration.closest_points import ScanTree, fit_closest, fit_elastic
from riemhuman.registration.posing import Pose, posed
from riemhuman.registration.results import RegisteredScan
from riemhuman.registration.scans import ReadyScan, Scan, as_scan, made_ready
from riemhuman.registration.start_poses import joint_names
from riemhuman.registration.starts import Candidate, StartSearch
from riemhuman.registration.trust import (
    AREA,
    NEAR_METRES,
    RIVAL_METRES,
    Evidence,
    distance_apart,
    doubts,
)
from riemhuman.surfaces.distortion import triangle_areas
from riemhuman.surfaces.nearest_places import nearest_places
from riemhuman.units import UNITS

AXES = {
    "x": (1.0, 0.0, 0.0),
    "y": (0.0, 1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
    "-x": (-1.0, 0.0, 0.0),
    "-y": (0.0, -1.0, 0.0),
    "-z": (0.0, 0.0, -1.0),
}
"""Names of the ways up."""

_N_DENSE = 3000
_MATCHED_METRES = 0.02
# Joints that move a smaller share of the vertices say nothing.
_LIMB = 0.01
# A frame may be less likely than the one before by so much before it is started anew.
_WARM_LOSS = 0.25
# Estimated normals of which fewer agree with the body are taken without their signs.
_AGREEMENT = 0.85


@dataclass(frozen=True)
class ScanRegistration:
    """Registers scans by a body model: meshes or point clouds of any heading, with holes and noise.

    Many starts, of headings and poses, are annealed by soft assignment and the likeliest goes on
    (`riemhuman.registration.starts`). Closest points then decide its parameters, and at last the
    surface leaves the model as far as the elastic metric (a, λ, c) = (1, 1, 1) allows.

    Parameters
    ----------
    model : BodyModel, optional
        The model; by default the open one at full resolution. Start poses are known for models
        with its joint names and for those of the SMPL family; of others, only the rest pose.
    unit : {"metres", "centimetres", "millimetres", "inches"}, optional
        Unit of the scans; noticed from their sizes by default.
    up : {"x", "y", "z", "-x", "-y", "-z"}, optional
        Which way is up in the scans; found by default, by the floor or by trying all six.

    Raises
    ------
    ArgumentTypeError
        If `model` is no body model.
    ArgumentError
        If there is no such unit or axis.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> scan = rh.registration.simulated_scan(bodies[0], bodies.template.faces, rng=0)
    >>> registration = rh.registration.ScanRegistration(bodies.model, up="y")
    >>> result = registration.solve(scan.points)  # doctest: +SKIP
    >>> result.trusted  # doctest: +SKIP
    True
    """

    model: BodyModel = field(default_factory=load_open_model)
    unit: str | None = None
    up: str | None = None

    def __post_init__(self) -> None:
        model: Any = self.model
        if not isinstance(model, BodyModel):
            raise ArgumentTypeError(f"model must be a BodyModel; found {type(model).__name__}")
        one_of(self.unit, "unit", (None, *UNITS))
        one_of(self.up, "up", (None, *AXES))

    def solve(
        self,
        scan: Any,
        *,
        landmarks: Mapping[str, Any] | None = None,
        start: RegisteredScan | None = None,
    ) -> RegisteredScan:
        """Register a scan.

        Parameters
        ----------
        scan : path, Scan, array_like or pair
            A file; points, shape (N, 3), or (N, 6) with normals; or vertices and faces.
        landmarks : mapping of str to array_like, shape (3,), optional
            Where joints of the model are in the scan, in its unit, within some centimetres.
        start : RegisteredScan, optional
            A scan of the same person shortly before: the search begins there.

        Returns
        -------
        result : RegisteredScan

        Raises
        ------
        ArgumentTypeError
            If the scan holds no numbers.
        ArgumentError
            If a shape is wrong, an entry is not finite, too few points are left, the size is that
            of no body, or the model has no joint of a landmark's name.
        FileError
            If the file is missing or cannot be read.
        FileFormatError
            If the file is damaged.
        """
        whole = as_scan(scan, self.unit)
        known = self._landmarks(landmarks or {}, whole.unit)
        ready = made_ready(whole)
        with single_threaded_libraries():
            candidates, ready = self._candidates(ready, known, start)
            return self._registered(whole, ready, candidates)

    def solve_sequence(
        self, scans: Iterable[Any], *, progress: bool = False
    ) -> list[RegisteredScan]:
        """Register scans of one person in motion, each started from the one before.

        Where a start from the scan before leads to something less likely, or where that was not
        to be trusted, the scan is started anew.

        Parameters
        ----------
        scans : iterable
            Scans as `solve` takes them, in their order.
        progress : bool
            Whether to show a progress bar.

        Returns
        -------
        results : list of RegisteredScan
            In the order of the scans; those that were finished, where it was interrupted from the
            keyboard.

        Raises
        ------
        RiemhumanError
            As `solve` does.
        """
        results: list[RegisteredScan] = []
        try:
            for scan in ProgressBar(scans, desc="Scans", unit="scan", disable=not progress):
                before = results[-1] if results and results[-1].trusted else None
                results.append(self.solve(scan, start=before))
        except KeyboardInterrupt:
            return results
        return results

    @cached_property
    def _search(self) -> StartSearch:
        return StartSearch(self.model)

    @cached_property
    def _metric(self) -> ElasticMetric:
        return ElasticMetric(AlignedSurfaces(self.model.template), a=1.0, lam=1.0, c=1.0)

    def _landmarks(self, landmarks: Mapping[str, Any], unit: str) -> dict[int, np.ndarray]:
        names = joint_names(self.model)
        places = {}
        for name, place in landmarks.items():
            if name not in names:
                raise ArgumentError(
                    f"landmarks has {name!r}; the joints of the model are {', '.join(names)}"
                )
            where = real_array(place, f"landmarks[{name!r}]", (3,), batched=False)
            places[names.index(name)] = np.asarray(where, dtype=float) / UNITS[unit]
        return places

    def _candidates(
        self,
        ready: ReadyScan,
        landmarks: dict[int, np.ndarray],
        start: RegisteredScan | None,
    ) -> tuple[list[Candidate], ReadyScan]:
        """Return the likeliest bodies, and the scan with normals that face as theirs do."""
        up = ready.up if self.up is None else np.array(AXES[self.up])

        def found(signed: bool) -> list[Candidate]:
            if start is not None and start.fit is not None:
                warm = self._search.run_from(
                    _pose(start.fit),
                    start.up,
                    ready.points,
                    ready.normals,
                    signed=signed,
                    landmarks=landmarks,
                )
                if self._likelihood(warm, ready) > start.likelihood - _WARM_LOSS:
                    return [warm]
            return self._search.run(
                ready.points, ready.normals, up=up, signed=signed, landmarks=landmarks
            )

        candidates = found(True)
        if not ready.estimated:
            return candidates, ready
        faced, agreement = self._faced(ready, candidates[0].pose)
        if agreement < _AGREEMENT:
            candidates = found(False)
            faced, _ = self._faced(ready, candidates[0].pose)
        return candidates, replace(ready, normals=faced)

    def _faced(self, ready: ReadyScan, pose: Pose) -> tuple[np.ndarray, float]:
        """Return estimated normals on the side of the body's, and how many were there before."""
        n_vertices, body = _N_DENSE, self._search.samples(_N_DENSE)
        points, normals = (each[body.numbers >= 0] for each in posed(body, pose))
        near = cKDTree(points).query(ready.points, k=min(5, n_vertices))[1]
        cosines = np.einsum("nkx,nx->n", normals[near], ready.normals)
        signs = np.where(cosines < 0, -1.0, 1.0)
        return signs[:, np.newaxis] * ready.normals, float(np.mean(cosines >= 0))

    def _likelihood(self, candidate: Candidate, ready: ReadyScan) -> float:
        """Return the log-likelihood for a body of the standard area."""
        likelihood = self._search.likelihood(candidate.pose, ready.points, ready.normals)
        return likelihood + float(np.log(self._area(candidate.pose) / AREA))

    def _area(self, pose: Pose) -> float:
        """Return the area of the skin in the rest pose."""
        return float(triangle_areas(self.model(pose.betas), self.model.faces).sum())

    def _least_matched(self, matched: np.ndarray) -> tuple[str, float]:
        """Return the joint whose vertices have found the least, and the share that found it."""
        owners = self.model.weights.argmax(axis=1)
        counts = np.bincount(owners, minlength=self.model.n_joints)
        found = np.bincount(owners, matched, minlength=self.model.n_joints)
        shares = np.where(counts >= _LIMB * len(owners), found / np.maximum(counts, 1), 1.0)
        least = int(np.argmin(shares))
        return joint_names(self.model)[least], float(shares[least])

    def _registered(
        self, whole: Scan, ready: ReadyScan, candidates: list[Candidate]
    ) -> RegisteredScan:
        best = candidates[0]
        tree = ScanTree(ready.points, ready.normals)
        pose = fit_closest(self._search.samples(_N_DENSE), best.pose, best.prior, tree)
        model_points = posed(self._search.samples(None), pose)[0][: self.model.n_vertices]
        points, found = fit_elastic(self._metric, model_points, model_points, tree)
        places, distances = nearest_places(whole.points, points, self.model.faces)
        background = ready.background
        body = self._search.samples(1000)
        own = posed(body, best.pose)[0]
        rivals = [
            each.likelihood
            for each in candidates[1:]
            if distance_apart(posed(body, each.pose)[0], own) > RIVAL_METRES
        ]
        likelihood = self._likelihood(replace(best, pose=pose), ready)
        moved = np.linalg.norm(points - model_points, axis=1)
        gaps = np.linalg.norm(found.gaps, axis=1)
        matched = (gaps < _MATCHED_METRES) & (found.weights > 0.1)
        limb, limb_matched = self._least_matched(matched)
        reasons = doubts(
            Evidence(
                strain=float(moved.mean()),
                likelihood=likelihood,
                margin=best.likelihood - max(rivals, default=-np.inf),
                near=float(np.mean(distances[~background] < NEAR_METRES)),
                betas=float(np.sqrt(np.mean(pose.betas**2))) if len(pose.betas) else 0.0,
                limb=limb,
                limb_matched=limb_matched,
            )
        )
        return RegisteredScan(
            points=points,
            trusted=not reasons,
            message="; ".join(reasons),
            likelihood=likelihood,
            fit=ModelFit(
                betas=pose.betas,
                pose=Rotation.from_matrix(pose.local).as_rotvec(),
                trans=pose.trans,
                distances=moved,
                converged=np.array(True),
                n_iterations=np.array(0),
            ),
            distances=distances,
            matched=matched,
            correspondence=places,
            background=background,
            up=best.up,
            unit=whole.unit,
        )


def _pose(fit: ModelFit) -> Pose:
    local = Rotation.from_rotvec(fit.pose).as_matrix()
    return Pose(np.ascontiguousarray(local), fit.betas, fit.trans)
