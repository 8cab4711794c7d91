"""Registration of scans by a body model, without landmarks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation
from tqdm import tqdm

from riemhuman.arrays import Array, ArrayLike
from riemhuman.bodies import BodyModel, ModelFit
from riemhuman.checks import (
    UNITS,
    check_instance,
    checked,
    choice,
    each,
    flag,
    instance,
    real_array,
)
from riemhuman.datasets import load_open_model
from riemhuman.errors import ArgumentError
from riemhuman.kernels.rotations import rotation_matrix
from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.registration._messages import join_reasons
from riemhuman.registration._one_person import fit_together
from riemhuman.registration._pipeline import ScanTask, register_scan, upright_transform
from riemhuman.registration._posed_body import Pose
from riemhuman.registration._registration_model import RegistrationModel
from riemhuman.registration._scan_preparation import prepare_scan
from riemhuman.registration._start_search import Candidate
from riemhuman.registration._verdict import judge_together
from riemhuman.registration.registered_scans import RegisteredScan, RegistrationTrace
from riemhuman.registration.registration_settings import DEFAULT_SETTINGS, RegistrationSettings
from riemhuman.registration.scans import as_scan
from riemhuman.surfaces.procrustes import AXES

# Fits use single precision, and scanners' stages are nearer to the origin than this. The limit
# follows from the precision, so it is not a setting.
_FAR_METRES_AWAY = 100.0
_UP = dict(zip(AXES, (*np.eye(3), *-np.eye(3)), strict=True))
# A landmark farther from the scan's median point is in another unit, or of another scan.
_FARTHEST_LANDMARK = 5.0


_scans = each(lambda scan, name: scan, "scans, such as a list of them")


@checked(
    model=instance(BodyModel),
    unit=choice(*UNITS),
    up=choice(*_UP),
    clothed=flag,
    settings=instance(RegistrationSettings, "RegistrationSettings"),
)
@dataclass(frozen=True)
class ScanRegistration:
    """Registers scans by a body model: meshes or point clouds with holes and noise, facing any way.

    Many starts with different headings and poses are fitted by soft assignment. For the most likely
    body, the arm positions of all starting poses are tried; closest points then determine its
    parameters. The surface then departs from the model as far as the elastic metric (a, λ, c) =
    (1, 1, 1) allows, and the model is fitted to it again, twice. If the result is not trusted,
    other starts are tried, and also bodies without legs or without everything above the waist. With
    `clothed`, the body beneath the clothes is found last.

    Parameters
    ----------
    model : BodyModel, optional
        By default the open model at full resolution. There are starting poses for models with its
        joint names and for the SMPL family; other models start from the rest pose only.
    unit : {"metres", "centimetres", "millimetres", "inches"}, optional
        Unit of the scans; by default it is inferred from their sizes.
    up : {"x", "y", "z", "-x", "-y", "-z"}, optional
        Up direction in the scans; by default it is inferred from the floor or by trying all six.
    clothed : bool
        Whether the scans show people in clothes. The body then lies beneath them: on the scan where
        it is bare or cloth is tight, elsewhere inside it, as thick as the closest places and the
        other people whom the model knows suggest. Vertices under loose clothes are not trusted.
    settings : RegistrationSettings
        Where registrations start, and how close they get.

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
    clothed: bool = False
    settings: RegistrationSettings = DEFAULT_SETTINGS

    @checked(start=instance(RegisteredScan), trace=flag)
    def solve(
        self,
        scan: object,
        *,
        landmarks: Mapping[str, ArrayLike] | None = None,
        start: RegisteredScan | None = None,
        trace: bool = False,
    ) -> RegisteredScan:
        """Register a scan.

        If it is stopped from the keyboard, it raises KeyboardInterrupt and nothing is kept, because
        there is no surface before the dense fit at the end. For folders and sequences, the finished
        scans are kept.

        Parameters
        ----------
        scan : path, Scan, mesh, array_like or pair
            A file; a mesh of trimesh, PyVista or meshio; points, shape (N, 3), or (N, 6) with
            normals; or vertices and faces.
        landmarks : mapping of str to array_like, shape (3,), optional
            Rough positions of joints of the model in the scan, in its unit.
        start : RegisteredScan, optional
            Registration of the same person in the previous frame.
        trace : bool
            Whether the result keeps the results of all stages, as its `trace`.

        Raises
        ------
        ArgumentError
            If fewer than 200 points are left without the background, or if the scan does not have
            the size of a body.
        """
        body = self._body
        whole = as_scan(scan, self.unit)
        centre = np.median(whole.points, axis=0)
        known = self._landmark_positions({} if landmarks is None else landmarks, centre, whole.unit)
        offset = _offset(centre)
        if offset.any():
            known = {number: position - offset for number, position in known.items()}
            start = None if start is None else _moved(start, -offset)
            whole = replace(whole, points=whole.points - offset)
        up = None if self.up is None else _UP[self.up]
        prepared = prepare_scan(
            whole, most_points=self.settings.most_points, up=up, landmarks=known
        )
        prepared = replace(prepared, clothed=self.clothed)
        task = ScanTask(
            body, prepared, up_is_known=self.up is not None, unit_is_known=self.unit is not None
        )
        with single_threaded_libraries():
            stages = register_scan(task, None if start is None else known_body(body, start))
        return _moved(result_of(stages, trace=trace), offset)

    @checked(scans=_scans, progress=flag)
    def solve_sequence(
        self, scans: Iterable[object], *, progress: bool = False
    ) -> list[RegisteredScan]:
        """Register scans of one person in motion, each starting from the previous one.

        A scan is registered from scratch if the previous one is not trusted or leads to a much
        lower likelihood. If it is interrupted from the keyboard, the finished scans are kept.

        Parameters
        ----------
        scans : iterable
            Scans as for `solve`, in order.
        progress : bool
            Whether to show a progress bar.
        """
        results: list[RegisteredScan] = []
        with suppress(KeyboardInterrupt):
            for scan in tqdm(scans, desc="Scans", unit="scan", disable=not progress):
                before = results[-1] if results and results[-1].trusted else None
                results.append(self.solve(scan, start=before))
        return results

    @checked(scans=_scans, progress=flag)
    def solve_together(
        self, scans: Iterable[object], *, progress: bool = False
    ) -> list[RegisteredScan]:
        """Register several scans of one person, who has not changed between them.

        Each is first registered alone. Those that are trusted then get one common shape and skin,
        to which each contributes what it shows; only their poses differ. Vertices that a scan does
        not show are trusted if another shows them, and if this one shows enough of the same part
        of the body, fingers excepted. A scan whose body is too far from the common shape, as
        another person's is, stays as it is, and its message says so. Register the scans of two
        visits separately, because a change between them would be averaged away.

        Parameters
        ----------
        scans : iterable
            Scans as for `solve`.
        progress : bool
            Whether to show a progress bar.

        Returns
        -------
        list of RegisteredScan
            One for each scan, in order, without its `trace`.

        Raises
        ------
        ArgumentError
            If `clothed` is True: clothes hide different parts in every scan.
        """
        check_unclothed(self)
        bar = tqdm(scans, desc="Scans", unit="scan", disable=not progress)
        results = [self.solve(scan, trace=True) for scan in bar]
        return share_person(results)

    @cached_property
    def _body(self) -> RegistrationModel:
        body = RegistrationModel(self.model, self.settings)
        _ = body.poses  # refuses unknown names before a scan is read
        if self.clothed and not body.parts.bare.any():
            raise ArgumentError(
                "clothed=True needs a model whose joints name the head or the hands, which are "
                f"bare; found {', '.join(body.parts.names)}"
            )
        return body

    def _landmark_positions(
        self, landmarks: Mapping[str, ArrayLike], centre: Array, unit: str
    ) -> dict[int, Array]:
        """Return the positions of joints by number, metres."""
        expected = "a mapping of joints to positions, {'left_wrist': [x, y, z]}"
        check_instance(landmarks, "landmarks", Mapping, expected)
        names = self._body.parts.names
        positions = {}
        for name, given in landmarks.items():
            if name not in names:
                raise ArgumentError(
                    f"landmarks has {name!r}; the joints of the model are {', '.join(names)}"
                )
            position = real_array(given, f"landmarks[{name!r}]", (3,), batched=False)
            position = np.asarray(position, dtype=float) / UNITS[unit]
            if np.abs(position - centre).max() > _FARTHEST_LANDMARK:
                raise ArgumentError(
                    f"landmarks[{name!r}] must lie in the scan, in its unit, {unit}; found "
                    f"{np.asarray(given).tolist()}, more than {_FARTHEST_LANDMARK:g} m away"
                )
            positions[names.index(name)] = position
        return positions


def check_unclothed(registration: ScanRegistration) -> None:
    """Refuse to register clothed scans together."""
    if registration.clothed:
        raise ArgumentError("scans are registered together without clothes; found clothed=True")


def share_person(results: Sequence[RegisteredScan]) -> list[RegisteredScan]:
    """Return registrations that share the person, from those of each scan alone with their traces.

    Those that are not trusted stay as they are.
    """
    shared = [replace(result, trace=None) for result in results]
    numbers = [k for k, result in enumerate(results) if result.trusted]
    traces = [trace for k in numbers if (trace := results[k].trace) is not None]
    with single_threaded_libraries():
        fits = fit_together(traces)
    for k, trace, found in zip(numbers, traces, fits, strict=True):
        if found is None:
            if len(traces) > 1:
                said = [results[k].message] if results[k].message else []
                said.append(
                    "its shape differs from that of the other scans, so that it was registered "
                    "alone: it shows another person, or a limb is in a wrong place"
                )
                shared[k] = replace(shared[k], message=join_reasons(said))
            continue
        verdict = judge_together(trace.verdict, trace.search, found.fit, found.borrowed)
        stages = replace(trace, elastic=found.fit, verdict=verdict)
        fit = results[k].fit
        offset = np.zeros(3) if fit is None else np.round(fit.trans - trace.elastic.pose.trans)
        shared[k] = _moved(result_of(stages, trace=False), offset)
    return shared


def known_body(body: RegistrationModel, start: RegisteredScan) -> Candidate | None:
    """Return the start of a search from a registration of the same person a moment before."""
    fit = start.fit
    if fit is None:
        return None
    pose = Pose(rotation_matrix(fit.pose), np.concatenate([fit.betas, fit.hands]), fit.trans)
    return Candidate(pose, body.prior(pose), start.likelihood, start.up, known=True)


def result_of(stages: RegistrationTrace, *, trace: bool) -> RegisteredScan:
    """Return the result of a registration, with its stages if they are asked for."""
    body, scan, verdict = stages.search.body, stages.search.scan, stages.verdict
    fit = stages.elastic
    betas, hands = np.split(fit.pose.betas, [body.model.n_betas])
    return RegisteredScan(
        points=fit.points,
        trusted=verdict.trusted,
        trusted_vertices=verdict.trusted_vertices,
        message=verdict.message,
        likelihood=verdict.likelihood,
        fit=ModelFit(
            betas=betas,
            pose=Rotation.from_matrix(fit.pose.local).as_rotvec(),
            trans=fit.pose.trans,
            distances=np.linalg.norm(fit.points - fit.model_points, axis=1),
            converged=np.array(True),
            n_iterations=np.array(0),
            hands=hands,
        ),
        distances=verdict.distances,
        matched=verdict.matched,
        correspondence=verdict.correspondence,
        background=verdict.background,
        up=stages.up,
        transform=upright_transform(fit.points, fit.pose.local[body.root], stages.up),
        unit=scan.whole.unit,
        faces=body.model.faces,
        scan=scan.whole,
        trace=stages if trace else None,
    )


def _offset(centre: Array) -> Array:
    """Return the place of a scan so far away that single precision would not do, else zeros."""
    return np.round(centre) if np.abs(centre).max() > _FAR_METRES_AWAY else np.zeros(3)


def _moved(result: RegisteredScan, offset: Array) -> RegisteredScan:
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
