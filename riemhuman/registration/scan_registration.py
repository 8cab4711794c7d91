"""Registration of scans by a body model without landmarks, or by a template."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from typing import Any

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from riemhuman.bodies import BodyModel, ModelFit, correspondence_matrix
from riemhuman.bodies.skinning import JointMotions, Skeleton
from riemhuman.checks import UNITS, likely_units, one_of, real_array, refuse_type
from riemhuman.datasets import load_open_model
from riemhuman.errors import ArgumentError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.kernels.rotations import rotation_matrix
from riemhuman.kernels.surface import vertex_normals
from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.progress import ProgressBar
from riemhuman.registration._arms_and_hands import fit_body
from riemhuman.registration._dense_fit import DenseFitter, fit_elastic
from riemhuman.registration._limb_rivals import find_limb_doubts
from riemhuman.registration._messages import in_words, say_unseen
from riemhuman.registration._posed_body import Pose, pose_body
from riemhuman.registration._scan_preparation import PreparedScan, prepare_scan
from riemhuman.registration._start_poses import BodyParts
from riemhuman.registration._start_search import Candidate
from riemhuman.registration._trust import (
    AREA,
    FAR_SHARE,
    LEAST_NEAR,
    NEAR_METRES,
    RIVAL_METRES,
    find_doubts,
    find_lost_limbs,
    find_overlaps,
    find_seen,
    join_reasons,
)
from riemhuman.registration.scans import Scan, as_scan
from riemhuman.surfaces.measures import triangle_areas
from riemhuman.surfaces.nearest_points import SurfacePoints, nearest_points
from riemhuman.surfaces.procrustes import AXES, procrustes
from riemhuman.surfaces.template import Template


@dataclass(frozen=True, eq=False)
class RegisteredScan:
    """A registered scan, and whether to trust it.

    Attributes
    ----------
    points : array, shape (V, 3)
        The registered surface at the place of the scan, metres.
    trusted : bool
        Whether the body passed all checks. Hands that something else explains almost as well
        leave it trusted: `trusted_vertices` lacks them, and the message names them.
    trusted_vertices : array of bool, shape (V,)
        Vertices that the scan shows, or that are within 6 cm of these along the surface and not
        more than 1.5 cm outside what it shows, as straight fingers of a fist are. False for limbs
        in doubt: another turn of a forearm, another pose of a hand, or both arms exchanged, is
        almost as near to the scan, or hands hide each other's fingers. All False if the body is
        not trusted, but for a limb alone in doubt.
    message : str
        The checks that the result failed, limbs in doubt, and parts that the scan does not show.
    likelihood : float
        Mean log-likelihood of the scan points for a body of 1.8 square metres; NaN without a model.
    fit : ModelFit or None
        Betas, pose, trans and hands of the model, and the distances of `points` from it.
    distances : array, shape (N,)
        Distance of each point of the scan from the registered surface, metres.
    matched : array of bool, shape (V,)
        Vertices within 2 cm of matching points of the scan; the positions of the others follow from
        the model and the elastic metric.
    correspondence : SurfacePoints
        The nearest point on the surface for each point of the scan.
    background : array of bool, shape (N,)
        Points of the scan classified as floor, strays or hair.
    up : array, shape (3,)
        The direction up in the scan.
    transform : array, shape (4, 4)
        The rigid motion from the axes of the scan, metres, to upright ones: y up, the body facing
        z, standing on the ground in the middle of the axes. The identity without a model.
    unit : str
        The unit of the scan.
    faces : array of int, shape (F, 3)
        Triangles of the registered surface.
    scan : Scan
        The scan, metres.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> registration = rh.registration.TemplateRegistration(bodies.template)
    >>> result = registration.solve((bodies[0], bodies.template.faces), start=bodies[0])
    >>> result.trusted, result.points.shape
    (True, (1202, 3))
    """

    points: np.ndarray
    trusted: bool
    trusted_vertices: np.ndarray
    message: str
    likelihood: float
    fit: ModelFit | None
    distances: np.ndarray
    matched: np.ndarray
    correspondence: SurfacePoints
    background: np.ndarray
    up: np.ndarray
    transform: np.ndarray
    unit: str
    faces: np.ndarray
    scan: Scan

    @property
    def upright_points(self) -> np.ndarray:
        """The registered surface in upright axes, facing z, on the ground; shape (V, 3), metres."""
        return apply_transform(self.transform, self.points)

    def __repr__(self) -> str:
        share = 100.0 * self.matched.mean()
        body = self.distances[~self.background]
        return (
            f"<RegisteredScan: {'trusted' if self.trusted else 'not trusted'}, "
            f"{1000.0 * np.median(body):.1f} mm median distance, {share:.0f} % of the vertices "
            f"matched{'; ' + self.message if self.message else ''}>"
        )


_SIDES = ("left", "right")
# Fits are in single precision; a scanner's stage is nearer to the origin than this.
_FAR_METRES_AWAY = 100.0
_UP = dict(zip(AXES, (*np.eye(3), *-np.eye(3)), strict=True))

_N_DENSE = 3000
_MATCHED_METRES = 0.02
# A landmark farther from the scan's median point is in another unit, or of another scan.
_FARTHEST_LANDMARK = 5.0
# Cosine of the pelvis' left with the horizontal below which the forward direction is used instead.
_LEAST_LEVEL = 0.3
# Cosine of the direction up with the normal of a floor; planes that lean more are walls.
_LEAST_LEVEL_FLOOR = 0.8
# Unseen parts are named if they are more than this share of the surface together.
_LEAST_UNSEEN = 0.1
# With a larger unseen share, the direction up is a guess.
_GUESSED_UP = 0.25
# Cosines of 25°, by which feet and trunk must lean from an axis, and of 30° between the feet.
_LEANING, _FEET_AGREE = 0.906, 0.866
# A joint farther from its landmark is wrong, metres.
_FARTHEST_MISS = 0.12
# A whole body fitted to half a one is near this share of it.
_NEAR_OF_HALF = 0.9
# A view from one side matches nearly half of the legs; legs fitted to the trunk, about a third.
_LEAST_MATCHED_HALF = 0.4
# What the likelihood gains where another search leads to another body.
_RETRY_GAIN = 0.05
# A frame whose likelihood falls by more than this below the one before is searched from scratch.
_WARM_LOSS = 0.25
# If a smaller share of the estimated normals agree with the body, their signs are ignored.
_AGREEMENT = 0.85


@dataclass(frozen=True)
class ScanRegistration:
    """Registers scans by a body model: meshes or point clouds of any heading, with holes and noise.

    Many starts with different headings and poses are fitted by soft assignment. The arms of the
    likeliest are tried in the positions of all start poses, and finer soft assignment and closest
    points determine its parameters. The surface then leaves the model as far as the elastic metric
    (a, λ, c) = (1, 1, 1) allows, and the model is fitted to it again, twice. If the result is not
    trusted, other starts are tried, and bodies without legs or without all above the waist.

    Parameters
    ----------
    model : BodyModel, optional
        By default the open model at full resolution. Start poses exist for models with its joint
        names and for the SMPL family; for others, only the rest pose.
    unit : {"metres", "centimetres", "millimetres", "inches"}, optional
        Unit of the scans; by default it is inferred from their sizes.
    up : {"x", "y", "z", "-x", "-y", "-z"}, optional
        Direction up in the scans; by default it is inferred from the floor or by trying all six.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> scan = rh.registration.simulated_scan(bodies[0], bodies.template.faces, rng=0)
    >>> registration = rh.registration.ScanRegistration(bodies.model, up="y")
    >>> result = registration.solve(scan.points)  # doctest: +SKIP
    """

    model: BodyModel = field(default_factory=load_open_model)
    unit: str | None = None
    up: str | None = None

    def __post_init__(self) -> None:
        model: Any = self.model
        if not isinstance(model, BodyModel):
            refuse_type(model, "model", "a BodyModel")
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
        scan : path, Scan, mesh, array_like or pair
            A file; a mesh of trimesh, PyVista or meshio; points, shape (N, 3), or (N, 6) with
            normals; or vertices and faces.
        landmarks : mapping of str to array_like, shape (3,), optional
            Rough positions of joints of the model in the scan, in its unit.
        start : RegisteredScan, optional
            Registration of the same person a moment before.

        Raises
        ------
        ArgumentError
            If fewer than 200 points are left without the background, or the size is not that of a
            body.
        """
        whole = as_scan(scan, self.unit)
        known = self._landmark_positions({} if landmarks is None else landmarks, whole)
        offset = _offset(whole.points)
        if offset.any():
            known = {number: position - offset for number, position in known.items()}
            start = None if start is None else _moved(start, -offset)
            whole = replace(whole, points=whole.points - offset)
        prepared = self._prepare(whole, known)
        return _moved(self._best(prepared, start), offset)

    def _best(self, prepared: PreparedScan, start: RegisteredScan | None) -> RegisteredScan:
        """Return the likeliest of the registrations of a whole and of half a body."""
        with single_threaded_libraries():

            @cache
            def half(number: int) -> RegisteredScan:
                return self._solve(self._partial_fitters[number], prepared)

            result = self._solve_whole(half, prepared, start)
            if not result.trusted:
                other = self._solve_again(half, prepared, result, again=start is None)
                if other.trusted or other.likelihood > result.likelihood + _RETRY_GAIN:
                    return other
            return result

    def solve_sequence(
        self, scans: Iterable[Any], *, progress: bool = False
    ) -> list[RegisteredScan]:
        """Register scans of one person in motion, each started from the one before.

        A scan is registered from scratch if the one before is not trusted or leads to a much lower
        likelihood. An interruption from the keyboard leaves the finished ones.

        Parameters
        ----------
        scans : iterable
            Scans as for `solve`, in order.
        progress : bool
            Whether to show a progress bar.
        """
        results: list[RegisteredScan] = []
        with suppress(KeyboardInterrupt):
            for scan in ProgressBar(scans, desc="Scans", unit="scan", disable=not progress):
                before = results[-1] if results and results[-1].trusted else None
                results.append(self.solve(scan, start=before))
        return results

    @cached_property
    def _fitter(self) -> DenseFitter:
        return DenseFitter(self.model)

    @cached_property
    def _partial_fitters(self) -> list[DenseFitter]:
        """Fitters of bodies without legs, and without what is above some height."""
        cuts = (-1, 1) if self._parts.halves else ()
        return [DenseFitter(self.model, cut) for cut in cuts]

    @property
    def _parts(self) -> BodyParts:
        return self._fitter.parts

    def _prepare(self, whole: Scan, known: dict[int, np.ndarray]) -> PreparedScan:
        prepared = prepare_scan(whole)
        if self.up is not None:
            up = _UP[self.up]
            is_floor = prepared.up is not None and prepared.up @ up > _LEAST_LEVEL_FLOOR
            floor = prepared.floor if is_floor else None
            prepared = replace(prepared, up=up, floor=floor, other_ups=())
        return replace(prepared, landmarks=known)

    def _landmark_positions(self, landmarks: Any, scan: Scan) -> dict[int, np.ndarray]:
        """Return the positions of joints by number, metres."""
        if not isinstance(landmarks, Mapping):
            expected = "a mapping of joints to positions, {'left_wrist': [x, y, z]}"
            refuse_type(landmarks, "landmarks", expected)
        names = self._parts.names
        centre = np.median(scan.points, axis=0)
        positions = {}
        for name, given in landmarks.items():
            if name not in names:
                raise ArgumentError(
                    f"landmarks has {name!r}; the joints of the model are {', '.join(names)}"
                )
            position = real_array(given, f"landmarks[{name!r}]", (3,), batched=False)
            position = np.asarray(position, dtype=float) / UNITS[scan.unit]
            if np.abs(position - centre).max() > _FARTHEST_LANDMARK:
                raise ArgumentError(
                    f"landmarks[{name!r}] must be in the scan, in its unit, {scan.unit}; found "
                    f"{np.asarray(given).tolist()}, more than {_FARTHEST_LANDMARK:g} m away"
                )
            positions[names.index(name)] = position
        return positions

    def _solve_whole(
        self,
        half: Callable[[int], RegisteredScan],
        scan: PreparedScan,
        start: RegisteredScan | None = None,
    ) -> RegisteredScan:
        """Return the result for a whole body, or for half a body if the scan shows no more."""
        return self._or_half(self._solve(self._fitter, scan, start), half)

    def _or_half(
        self, result: RegisteredScan, half: Callable[[int], RegisteredScan]
    ) -> RegisteredScan:
        """Return the result, or that for half a body if the scan shows no more."""
        # The model has no way to leave out legs: without points of their own, they are fitted to
        # the trunk and pull it out of place. Few of their vertices match then, and a body without
        # legs comes near to all of the scan.
        halves = self._parts.halves if result.trusted_vertices.any() else ()
        for number, missing in enumerate(halves):
            few = result.matched[missing].mean() < _LEAST_MATCHED_HALF
            if few and _near_share(half(number)) >= LEAST_NEAR:
                return half(number)
        return result

    def _solve(
        self,
        fitter: DenseFitter,
        scan: PreparedScan,
        start: RegisteredScan | None = None,
    ) -> RegisteredScan:
        """Return the result of one search."""
        return self._finish(fitter, *self._search_candidates(fitter, scan, start))

    def _solve_again(
        self,
        half: Callable[[int], RegisteredScan],
        scan: PreparedScan,
        result: RegisteredScan,
        *,
        again: bool,
    ) -> RegisteredScan:
        """Return the result from other starts, without a direction up from a floor, or of a half.

        Only the likeliest of these searches is followed to its end.
        """
        searches = [(self._fitter, *self._search_candidates(self._fitter, scan, again=again))]
        others = []
        if scan.floor is not None and self.up is None:
            others.append((self._fitter, replace(scan, up=None, floor=None, other_ups=())))
        if not result.trusted_vertices.any() and _near_share(result) > _NEAR_OF_HALF:
            others += [(fitter, scan) for fitter in self._partial_fitters]
        searches += [(f, *self._search_candidates(f, each, quick=True)) for f, each in others]

        def likelihood(fitter: DenseFitter, found: list[Candidate], target: PreparedScan) -> float:
            surface, up = fitter.surface(found[0].pose), found[0].up
            visible = fitter.find_visible(surface, target.points, up)
            return self._likelihood(fitter, found[0].pose, target, up, visible)

        fitter, candidates, target = max(searches, key=lambda search: likelihood(*search))
        if candidates is not searches[0][1]:
            candidates = fitter.with_likeliest_arms(candidates, target)
        other = self._finish(fitter, candidates, target)
        return self._or_half(other, half) if fitter is self._fitter else other

    def _finish(
        self, fitter: DenseFitter, candidates: list[Candidate], scan: PreparedScan
    ) -> RegisteredScan:
        """Return the result of the dense fit to the best candidate of a search."""
        parts, whole, template = self._parts, scan.whole, self.model.template
        up = candidates[0].up
        body = fit_body(fitter, candidates[0], scan)
        fit, rivals = body.fit, find_limb_doubts(body)
        pose, points, model_points = fit.pose, fit.points, fit.model_points
        betas, hands = np.split(pose.betas, [self.model.n_betas])
        places, distances = nearest_points(whole.points, points, self.model.faces)
        background = scan.background | fitter.find_hair(model_points, whole.points)
        visible = fitter.find_visible(model_points, scan.points, up)
        likelihood = self._likelihood(fitter, pose, scan, up, visible)
        near = fit.matches.distances < _MATCHED_METRES
        matched = visible & near & (fit.matches.reliable > 0.1)
        some = scan.points[scan.even_points(_N_DENSE)]
        some = some[~fitter.find_hair(model_points, some)]
        _, gaps = nearest_points(some, points, self.model.faces)
        _, model_distances = nearest_points(some, model_points, self.model.faces)
        # Hands that lie on the body are thin enough to be where it is, though they are right.
        overlaps = find_overlaps(template, points, matched & ~parts.on_hands)
        lost = find_lost_limbs(parts, points, matched, overlaps)
        if lost.any():
            overlaps = find_overlaps(template, points, matched & ~parts.on_hands & ~lost)
        seen = find_seen(template, points, matched, scan) & visible & ~lost
        shares = parts.shares(matched)
        limb = int(np.argmin(shares))
        doubts, limb_doubts = find_doubts(
            likelihood=likelihood,
            margin=self._margin(fitter, candidates, scan),
            near=float(np.mean(gaps < NEAR_METRES)),
            betas=float(np.sqrt(np.mean(betas**2))) if len(betas) else 0.0,
            far=float(np.quantile(model_distances, FAR_SHARE)),
            overlap=float(overlaps.sum() / max(matched.sum(), 1)),
            limb=in_words(parts.names[limb]),
            limb_matched=float(shares[limb]),
        )
        doubts += self._landmark_doubts(pose, scan)
        if doubts and self.unit is None:
            doubts = [*_other_units(whole, background), *doubts]
        trusted_vertices = seen & (not doubts)
        if limb_doubts:
            trusted_vertices &= ~parts.limb_vertices(limb)
        rivals = [doubt for doubt in rivals if (doubt.vertices & trusted_vertices).any()]
        for doubt in rivals:
            trusted_vertices = trusted_vertices & ~doubt.vertices
        if scan.up is None:
            up = self._standing_up(pose, up)
        elif scan.other_ups:
            up = self._upright_plane(pose, scan)
        return RegisteredScan(
            points=points,
            trusted=not doubts and not limb_doubts,
            trusted_vertices=trusted_vertices,
            message=join_reasons(
                [
                    *doubts,
                    *limb_doubts,
                    *(f"{doubt.reason} (not trusted)" for doubt in rivals),
                    *self._unseen_parts(seen, lost, scan),
                ]
            ),
            likelihood=likelihood,
            fit=ModelFit(
                betas=betas,
                pose=Rotation.from_matrix(pose.local).as_rotvec(),
                trans=pose.trans,
                distances=np.linalg.norm(points - model_points, axis=1),
                converged=np.array(True),
                n_iterations=np.array(0),
                hands=hands,
            ),
            distances=distances,
            matched=matched,
            correspondence=places,
            background=background,
            up=up,
            transform=_upright_transform(points, pose.local[fitter.root], up),
            unit=whole.unit,
            faces=self.model.faces,
            scan=whole,
        )

    def _search_candidates(
        self,
        fitter: DenseFitter,
        scan: PreparedScan,
        start: RegisteredScan | None = None,
        *,
        again: bool = False,
        quick: bool = False,
    ) -> tuple[list[Candidate], PreparedScan]:
        """Return the likeliest bodies, and the scan with normals oriented like theirs."""

        def search(target: PreparedScan) -> list[Candidate]:
            if start is not None and start.fit is not None:
                fit = start.fit
                betas = np.concatenate([fit.betas, fit.hands])
                pose = Pose(rotation_matrix(fit.pose), betas, fit.trans)
                warm = fitter.run_from(pose, start.up, target)
                likelihood = self._likelihood(fitter, warm.pose, scan, start.up)
                if likelihood > start.likelihood - _WARM_LOSS:
                    return [warm]
            return fitter.run(target, again=again, quick=quick)

        candidates = search(scan)
        if not scan.estimated and scan.parts is None:
            return candidates, scan
        normals, agreement = self._orient_normals(scan, candidates[0].pose)
        if agreement < _AGREEMENT:
            candidates = search(replace(scan, signed=False))
            normals, _ = self._orient_normals(scan, candidates[0].pose)
        return candidates, replace(scan, normals=normals)

    def _orient_normals(self, scan: PreparedScan, pose: Pose) -> tuple[np.ndarray, float]:
        """Return normals oriented like the body's, and the share that were before."""
        body = self._fitter.samples(_N_DENSE)
        posed, skin = pose_body(body, pose), body.numbers >= 0
        near = cKDTree(posed.points[skin]).query(scan.points, k=5)[1]
        cosines = np.einsum("nkx,nx->n", posed.normals[skin][near], scan.normals)
        if scan.parts is not None:  # which are oriented as a whole
            cosines = np.bincount(scan.parts, cosines)[scan.parts]
        signs = np.where(cosines < 0, -1.0, 1.0)
        return signs[:, np.newaxis] * scan.normals, float(np.mean(cosines >= 0))

    def _likelihood(
        self,
        fitter: DenseFitter,
        pose: Pose,
        scan: PreparedScan,
        up: np.ndarray,
        visible: np.ndarray | None = None,
    ) -> float:
        """Return the log-likelihood for a body of the standard area."""
        areas = triangle_areas(self.model(pose.betas[: self.model.n_betas]), self.model.faces)
        area = areas.sum() if visible is None else areas @ visible[self.model.faces[:, 0]]
        likelihood = fitter.likelihood(pose, scan, up)
        return likelihood + float(np.log(area / AREA))

    def _unseen_parts(self, seen: np.ndarray, lost: np.ndarray, scan: PreparedScan) -> list[str]:
        """Return what to say about the parts that a scan does not show."""
        areas = self.model.template.vertex_areas
        share = 1.0 - areas @ seen / areas.sum()
        if share < _LEAST_UNSEEN and not lost.any():
            return []
        names = self._parts.names
        unseen = [names[k] for k in np.flatnonzero(self._parts.shares(seen) < 0.5)]
        guessed_up = bool(share > _GUESSED_UP and scan.up is None)
        return [say_unseen(unseen, share, guessed_up=guessed_up)]

    def _standing_up(self, pose: Pose, up: np.ndarray) -> np.ndarray:
        """Return an axis, or the direction up of the feet if they and the trunk lean from it."""
        names = self._parts.names
        if not {"left_ankle", "right_ankle", "neck"} <= {*names}:
            return up
        motions = pose_body(self._fitter.samples(1000), pose).motions
        left, right = (motions.rotations[names.index(f"{s}_ankle")][:, 1] for s in _SIDES)
        trunk = motions.positions[names.index("neck")] - motions.positions[self._fitter.root]
        trunk, feet = (each / np.linalg.norm(each) for each in (trunk, left + right))
        leans = max(feet @ up, trunk @ up) < _LEANING and left @ right > _FEET_AGREE
        return feet if leans else up

    def _upright_plane(self, pose: Pose, scan: PreparedScan) -> np.ndarray:
        """Return the normal of the plane on which the trunk is upright, or that with most rest."""
        ups = [] if scan.up is None else [scan.up, *scan.other_ups]
        root = pose_body(self._fitter.samples(1000), pose).motions.rotations[self._fitter.root]
        best = max(ups, key=lambda up: float(root[:, 1] @ up))
        return best if root[:, 1] @ best > _LEANING else ups[0]

    def _landmark_doubts(self, pose: Pose, scan: PreparedScan) -> list[str]:
        joints = pose_body(self._fitter.samples(1000), pose).points[-self.model.n_joints :]
        misses = {k: np.linalg.norm(joints[k] - place) for k, place in scan.landmarks.items()}
        return [
            f"the {in_words(self._parts.names[k])} is {100 * miss:.0f} cm from its landmark"
            for k, miss in misses.items()
            if miss > _FARTHEST_MISS
        ]

    def _margin(
        self, fitter: DenseFitter, candidates: list[Candidate], scan: PreparedScan
    ) -> float:
        """Return how much likelier the best body is than all whose visible part is elsewhere."""
        body = fitter.samples(1000)
        own = pose_body(body, candidates[0].pose).points
        end = fitter.end_of(scan.points, candidates[0].up)
        shown = np.ones(len(own), bool) if end is None else (body.areas > 0) & end.shows(own)
        others = [
            each.likelihood
            for each in candidates[1:]
            if np.linalg.norm((pose_body(body, each.pose).points - own)[shown], axis=1).mean()
            > RIVAL_METRES
        ]
        return candidates[0].likelihood - max(others, default=-np.inf)


def _near_share(result: RegisteredScan) -> float:
    """Return the share of a scan, without its background, that is near the body."""
    return float(np.mean(result.distances[~result.background] < NEAR_METRES))


def _other_units(scan: Scan, background: np.ndarray) -> list[str]:
    """Return what to say if the size of a scan is that of a body in another unit too."""
    extent = float(np.ptp(scan.points[~background], axis=0).max())
    others = [unit for unit in likely_units(extent * UNITS[scan.unit]) if unit != scan.unit]
    return [
        f"the scan may be in {unit}: it is {extent:.2f} m long, and {scan.unit} were inferred "
        "from this size; the argument unit, or --unit, decides"
        for unit in others[:1]
    ]


def _offset(points: np.ndarray) -> np.ndarray:
    """Return the place of a scan so far away that single precision would not do, else zeros."""
    middle = np.median(points, axis=0)
    return np.round(middle) if np.abs(middle).max() > _FAR_METRES_AWAY else np.zeros(3)


def _moved(result: RegisteredScan, offset: np.ndarray) -> RegisteredScan:
    """Return the registration of a scan that is translated."""
    if not offset.any():
        return result
    fit = result.fit
    transform = result.transform.copy()
    transform[:3, 3] -= transform[:3, :3] @ offset
    return replace(
        result,
        points=result.points + offset,
        fit=None if fit is None else replace(fit, trans=fit.trans + offset),
        transform=transform,
        scan=replace(result.scan, points=result.scan.points + offset),
    )


def apply_transform(transform: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return points, shape (n, 3), after a rigid motion, shape (4, 4)."""
    moved: np.ndarray = points @ transform[:3, :3].T + transform[:3, 3]
    return moved


def _upright_transform(points: np.ndarray, root: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Return the rigid motion to y up, facing z, of a body with this rotation of its pelvis."""
    # The left side stays level in people who bend forward; models have x to the left, z forward.
    left = root[:, 0] - (root[:, 0] @ up) * up
    if np.linalg.norm(left) < _LEAST_LEVEL:  # someone who lies on one side
        left = np.cross(up, root[:, 2])
    left /= np.linalg.norm(left)
    rotation = np.stack([left, up, np.cross(left, up)])
    rotated = points @ rotation.T
    low, high = rotated.min(axis=0), rotated.max(axis=0)
    transform = np.eye(4)
    transform[:3, :3] = rotation
    transform[:3, 3] = -0.5 * (low + high)
    transform[1, 3] = -low[1]
    return transform


# Templates are scaled to the size of a body, for which all lengths below were chosen.
_SIZE = 2.0
_RIGID_SCALES = (0.4, 0.2, 0.2, 0.1, 0.1, 0.06, 0.06, 0.04)
_FREE_SCALES = (0.1, 0.06, 0.03, 0.015)
_STIFFNESSES = (3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4)
_NEAR_METRES = 0.02
# A registration is not trusted if a smaller share of the template, or of the scan, is matched.
_LEAST_MATCHED, _LEAST_NEAR = 0.3, 0.8


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
        template: Any = self.template
        if not isinstance(template, Template):
            refuse_type(template, "template", "a Template")
        if template.seams:
            raise ArgumentError(
                f"template has {template.seams.n_copies} doubled vertices along seams, which would "
                "tear; template.join_seams() joins them"
            )

    def solve(self, scan: Any, *, start: Any = None) -> RegisteredScan:
        """Register a scan, without a likelihood and a fit in the result.

        Parameters
        ----------
        scan : path, Scan, array_like or pair
            As for `ScanRegistration.solve`.
        start : array_like, shape (V, 3), optional
            The template roughly at the place of the scan; by default its own vertices.
        """
        template = self.template
        whole = as_scan(scan, "metres")  # which leaves any unit as it is
        if start is None:
            points = template.vertices
        else:
            shape = (template.n_vertices, 3)
            points = np.asarray(real_array(start, "start", shape, batched=False), dtype=float)
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

    def _fit(self, whole: Scan, prepared: PreparedScan, points: np.ndarray) -> RegisteredScan:
        faces = self.template.faces
        for scale in _RIGID_SCALES:
            matches = prepared.match(points, vertex_normals(points, faces), scale)
            weights = matches.weights * self.template.vertex_areas
            if not weights.any():
                raise ArgumentError("no part of start faces the same way as the scan near it")
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
            reasons.append(f"only {100 * matched.mean():.0f} % of the template match the scan")
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


def transfer_model(model: BodyModel, body: Template) -> BodyModel:
    r"""Transfer a body model to another mesh, from one body that has this mesh.

    The model is registered to the body. Each vertex of the body takes the skinning weights, shape
    directions and pose directions of its nearest point on the registered surface. Each joint is the
    combination of the points of the body nearest to the vertices that it combines in the model. The
    mean body in the rest pose is the body itself, with the fitted pose and the fitted shape undone:

    .. math:: \begin{split}
              v_i = & \Big(\sum_j w_{ij} R_j\Big)^{-1} \Big(f_i - \sum_j w_{ij} t_j\Big) \\
              & - \text{shapedirs}_i\, \beta - \text{posedirs}_i\,(R - I) \end{split}

    with the rigid motions :math:`x \mapsto R_j x + t_j` of the joints (Loper et al. 2015,
    equation 2). What the model cannot fit of the body stays in the mean body.

    The result makes and poses new bodies of the other mesh. To convert bodies that exist, use
    `TopologyMap`, which takes milliseconds a body and does not depend on what a model can show.

    Parameters
    ----------
    model : BodyModel
    body : Template
        A body with the other mesh, metres, in any pose without contacts.

    Raises
    ------
    ArgumentError
        If the registration of the model to the body is not trusted.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> body = rh.Template(bodies[0], bodies.template.faces)
    >>> model = rh.registration.transfer_model(bodies.model, body)  # doctest: +SKIP
    """
    vertices, faces = body.vertices, body.faces
    registered = ScanRegistration(model, unit="metres").solve((vertices, faces))
    fit = registered.fit
    if fit is None or not registered.trusted:
        raise ArgumentError(
            "body must be a body to which the model can be registered; found that "
            f"{registered.message}"
        )
    forth = correspondence_matrix(model, registered.correspondence)
    back = correspondence_matrix(body, nearest_points(registered.points, vertices, faces)[0])
    weights = forth @ model.weights
    shapedirs = _combined(forth, model.shapedirs)
    hand_directions = _combined(forth, model.hand_directions)
    posedirs = None if model.posedirs is None else _combined(forth, model.posedirs)

    local = rotation_matrix(fit.pose)
    motions = JointMotions(Skeleton(model, with_hands=False), local, fit.betas)
    blended = np.einsum("vj,jxy->vxy", weights, motions.rotations)
    moved = vertices - fit.trans - weights @ motions.shifts
    rest = np.linalg.solve(blended, moved[..., None])[..., 0]
    rest = rest - shapedirs @ fit.betas - hand_directions @ fit.hands
    if posedirs is not None:
        rest = rest - posedirs @ motions.pose_feature
    return BodyModel(
        rest,
        faces,
        shapedirs,
        model.joint_regressor @ back,
        weights,
        np.stack([model.parents, np.arange(model.n_joints)]),
        posedirs=posedirs,
        joint_names=model.joint_names,
        hand_directions=hand_directions,
        hand_poses=model.hand_poses,
        dtype=model.dtype,
    )


def _combined(combination: Any, directions: np.ndarray) -> np.ndarray:
    """Return directions of points from those of vertices, shape (V, 3, B)."""
    flat = combination @ directions.reshape(len(directions), -1)
    return np.asarray(flat).reshape(len(flat), *directions.shape[1:])
