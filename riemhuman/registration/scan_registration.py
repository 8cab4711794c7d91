"""Registration of scans by a body model, without landmarks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import itemgetter
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
from riemhuman.kernels.threads import mapped, single_threaded_libraries
from riemhuman.progress import ProgressBar
from riemhuman.registration.arms import arms_of, turned_forearms
from riemhuman.registration.closest_points import ScanTree, fit_closest, fit_elastic
from riemhuman.registration.posing import Pose, posed
from riemhuman.registration.results import RegisteredScan
from riemhuman.registration.scans import ReadyScan, Scan, as_scan, made_ready
from riemhuman.registration.start_poses import joint_names
from riemhuman.registration.starts import N_THREADS, Candidate, StartSearch
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
from riemhuman.surfaces.upright import AXES
from riemhuman.units import UNITS

_UP = dict(zip(AXES, (*np.eye(3), *-np.eye(3)), strict=True))

_N_DENSE = 3000
# Forearms are turned by so many points, and so often while the likelihood gains as much.
_N_TURNED, _N_PASSES, _LEAST_GAIN = 1000, 2, 0.002
_MATCHED_METRES = 0.02
# Joints that move a smaller share of the vertices are ignored.
_LIMB = 0.01
# A frame whose likelihood falls by more than this below the one before is searched from scratch.
_WARM_LOSS = 0.25
# If a smaller share of the estimated normals agree with the body, their signs are ignored.
_AGREEMENT = 0.85


@dataclass(frozen=True)
class ScanRegistration:
    """Registers scans by a body model: meshes or point clouds of any heading, with holes and noise.

    Many starts with different headings and poses are fitted by soft assignment, and the likeliest
    is kept (`riemhuman.registration.starts`), each of its arms tried as all start poses hold it
    (`riemhuman.registration.arms`). Closest points then determine its parameters, with forearms
    turned where that is likelier, and finally the surface may leave the model as far as the
    elastic metric (a, λ, c) = (1, 1, 1) allows.

    Parameters
    ----------
    model : BodyModel, optional
        The model; by default the open model at full resolution. Start poses exist for models with
        its joint names and for the SMPL family; for other models, only the rest pose.
    unit : {"metres", "centimetres", "millimetres", "inches"}, optional
        Unit of the scans; by default it is inferred from their sizes.
    up : {"x", "y", "z", "-x", "-y", "-z"}, optional
        Direction up in the scans; by default it is inferred from the floor or by trying all six.

    Raises
    ------
    ArgumentTypeError
        If `model` is not a body model.
    ArgumentError
        If the unit or the axis is unknown.

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
        one_of(self.up, "up", (None, *_UP))

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
            Positions of joints of the model in the scan, in its unit, within some centimetres.
        start : RegisteredScan, optional
            Registration of the same person a moment before, from which the search starts.

        Returns
        -------
        result : RegisteredScan

        Raises
        ------
        ArgumentTypeError
            If the scan does not hold numbers.
        ArgumentError
            If a shape is wrong, an entry is not finite, too few points are left, the size is not
            that of a body, or the model has no joint with the name of a landmark.
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

        A scan is registered from scratch if the one before is not trusted, or if the start from it
        leads to a much lower likelihood.

        Parameters
        ----------
        scans : iterable
            Scans as for `solve`, in order.
        progress : bool
            Whether to show a progress bar.

        Returns
        -------
        results : list of RegisteredScan
            In the order of the scans; after an interruption from the keyboard, the finished ones.

        Raises
        ------
        RiemhumanError
            As for `solve`.
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
        self, ready: ReadyScan, landmarks: dict[int, np.ndarray], start: RegisteredScan | None
    ) -> tuple[list[Candidate], ReadyScan]:
        """Return the likeliest bodies, and the scan with normals oriented like theirs."""
        up = ready.up if self.up is None else _UP[self.up]

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
        """Return estimated normals oriented like the body's, and the share that were before."""
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
        """Return the joint with the smallest share of matched vertices, and this share."""
        owners = self.model.weights.argmax(axis=1)
        counts = np.bincount(owners, minlength=self.model.n_joints)
        found = np.bincount(owners, matched, minlength=self.model.n_joints)
        shares = np.where(counts >= _LIMB * len(owners), found / np.maximum(counts, 1), 1.0)
        least = int(np.argmin(shares))
        return joint_names(self.model)[least], float(shares[least])

    def _with_forearms_turned(
        self, best: Candidate, pose: Pose, ready: ReadyScan, tree: ScanTree
    ) -> Pose:
        """Return a dense fit with forearms turned about themselves where that is likelier."""
        few, dense = self._search.samples(_N_TURNED), self._search.samples(_N_DENSE)

        def fitted(pose: Pose) -> tuple[float, Pose]:
            pose = fit_closest(few, pose, best.prior, tree)
            return likelihood(pose), pose

        def likelihood(pose: Pose) -> float:
            return self._likelihood(replace(best, pose=pose), ready)

        reached = likelihood(pose)
        for arm in arms_of(self.model):
            for _ in range(_N_PASSES):
                others = turned_forearms(pose, arm, few.rest_joints)
                found, other = max(mapped(fitted, others, N_THREADS), key=itemgetter(0))
                if found > reached - _LEAST_GAIN:
                    other = fit_closest(dense, other, best.prior, tree)
                    found = likelihood(other)
                if found < reached + _LEAST_GAIN:
                    break
                reached, pose = found, other
        return pose

    def _registered(
        self, whole: Scan, ready: ReadyScan, candidates: list[Candidate]
    ) -> RegisteredScan:
        best = candidates[0]
        tree = ScanTree(ready.points, ready.normals)
        pose = fit_closest(self._search.samples(_N_DENSE), best.pose, best.prior, tree)
        pose = self._with_forearms_turned(best, pose, ready, tree)
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
