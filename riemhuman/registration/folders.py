"""Registration of folders of scans, which an interrupted run resumes.

The output folder holds ``NAME.ply`` for every trusted registration, so that it is a folder of
registered meshes, ``partial/NAME.ply`` if the scan does not show all of the body,
``untrusted/NAME.ply`` for the others, and a record ``registrations/NAME.npz`` of every scan.
"""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree
from tqdm import tqdm

from riemhuman.arrays import Array, Values
from riemhuman.checks import checked, flag, instance, real_array
from riemhuman.datasets.registered_meshes import existing_folder
from riemhuman.errors import ArgumentError, FileError, FileFormatError, RiemhumanError, warn
from riemhuman.io.arrays import load_arrays, save_arrays
from riemhuman.io.files import convert_errors, file_path, natural_key, read_bytes, visible_files
from riemhuman.io.fingerprint import describe
from riemhuman.io.meshes import POINT_SUFFIXES, save_mesh
from riemhuman.registration._scan_preparation import even_points
from riemhuman.registration.registered_scans import RegisteredScan, apply_transform
from riemhuman.registration.scan_registration import (
    ScanRegistration,
    check_unclothed,
    share_person,
)
from riemhuman.registration.scans import Scan, load_scan
from riemhuman.solvers.results import Result, interruptible
from riemhuman.surfaces.measures import share_of_surface
from riemhuman.surfaces.nearest_points import nearest_points

UNTRUSTED, PARTIAL, RECORDS = "untrusted", "partial", "registrations"
_VERSION = 11
# Number of points of a scan that are kept for pictures.
_N_SHOWN = 12_000
# Points of a scan and of its record are in single precision. Farther points are background.
_SAME_METRES, _BACKGROUND_METRES = 1e-4, 0.05
# Fields of a record with the kinds of their arrays: Boolean, text or floating point.
_FIELDS = {
    "trusted": "b",
    "message": "U",
    "likelihood": "f",
    "median_distance": "f",
    "matched_share": "f",
}
_ARRAYS = (
    *("points", "up", "transform", "matched", "trusted_vertices"),
    *("faces", "shown", "shown_distances"),
    *("betas", "pose", "trans", "hands"),
)


@dataclass(frozen=True, eq=False)
class ScanRecord:
    """The record of a registered scan.

    Attributes
    ----------
    name : str
        Name of the scan's file without its suffix.
    trusted : bool
        Whether the registration is trusted.
    message : str
        See `RegisteredScan`; or the reason why the scan could not be registered.
    likelihood : float
        See `RegisteredScan`; NaN if the scan could not be registered.
    median_distance : float
        Median distance of the scan's points from the body, metres.
    matched_share : float
        Share of the surface of the body that the scan shows.
    arrays : dict of str to array
        The arrays of `RegisteredScan` in the axes of the scan, faces, and some points of the scan
        with their distances; empty if the scan could not be registered.

    Examples
    --------
    >>> record = rh.registration.read_records("bodies")[0]  # doctest: +SKIP
    >>> record.name, record.trusted  # doctest: +SKIP
    ('anna', True)
    """

    name: str
    trusted: bool
    message: str
    likelihood: float
    median_distance: float
    matched_share: float
    arrays: dict[str, Values]

    @checked(scan=instance(Scan))
    def result(self, scan: Scan) -> RegisteredScan:
        """Return the registration of the scan from which the record was made, without a model fit.

        Parameters
        ----------
        scan : Scan
            The scan, read by `load_scan` in the unit in which it was registered.

        Raises
        ------
        ArgumentError
            If the scan could not be registered, or if this is another scan.
        """
        if not self.arrays:
            raise ArgumentError(f"{self.name} was not registered: {self.message}")
        faces, points = self.arrays["faces"], self.arrays["points"]
        shown = np.asarray(self.arrays["shown"], dtype=np.float64)
        gaps = cKDTree(scan.points).query(shown)[0]
        if gaps.max(initial=0.0) > _SAME_METRES:
            raise ArgumentError(
                f"this is not the scan from which {self.name} was registered, or it is in "
                f"another unit: {gaps.max():.3g} m lie between their points"
            )
        places, distances = nearest_points(scan.points, points, faces)
        return RegisteredScan(
            points=points,
            trusted=self.trusted,
            trusted_vertices=self.arrays["trusted_vertices"].astype(bool),
            message=self.message,
            likelihood=self.likelihood,
            fit=None,
            distances=distances,
            matched=self.arrays["matched"].astype(bool),
            correspondence=places,
            background=distances > _BACKGROUND_METRES,
            up=self.arrays["up"],
            transform=self.arrays["transform"],
            unit=scan.unit,
            faces=faces,
            scan=scan,
        )


@dataclass(frozen=True, kw_only=True, repr=False)
class FolderResult(Result):
    """The finished part of a folder's registration that was stopped from the keyboard.

    Attributes
    ----------
    n_iterations, n_evaluations, status, message
        See `Result`; counts are 0.
    records : tuple of ScanRecord
        Records of the finished scans, in order; the output folder holds them as well.

    Examples
    --------
    >>> stopped = rh.solvers.Status.INTERRUPTED
    >>> rh.registration.FolderResult(records=(), status=stopped).converged
    False
    """

    records: tuple[ScanRecord, ...]


@checked(
    registration=instance(ScanRegistration),
    sequence=flag,
    same_person=flag,
    keep_axes=flag,
    progress=flag,
)
def register_folder(
    registration: ScanRegistration,
    scans: str | os.PathLike[str],
    output: str | os.PathLike[str],
    *,
    sequence: bool = False,
    same_person: bool = False,
    keep_axes: bool = False,
    progress: bool = False,
) -> list[ScanRecord]:
    """Register the scans of a folder, and return their records in order.

    A scan is skipped if the output already contains its registration, from the same file with the
    same model. A scan that cannot be read or registered is recorded with the reason. A warning
    names bodies whose scans are no longer there.

    Parameters
    ----------
    registration : ScanRegistration
    scans : path_like
        Folder with the scans, in the natural order of their names; subfolders are ignored.
    output : path_like
        Folder to write: trusted bodies, ``partial`` for incomplete ones, ``untrusted`` for others.
    sequence : bool
        Whether the scans show one person in motion, so that each starts from the previous one.
    same_person : bool
        Whether all scans show one person at one visit, see `ScanRegistration.solve_together`. A
        body then depends on all scans: nothing is written before the last one is registered, and
        everything is registered again if a scan is added or changed.
    keep_axes : bool
        Whether to write bodies at the positions of the scans. By default they stand upright
        (`RegisteredScan.transform`); those of a sequence are moved like its first body.
    progress : bool
        Whether to show a progress bar.

    Raises
    ------
    ArgumentError
        If `same_person` is combined with `sequence` or with clothed people.
    FileError
        If two scans have the same name, or a body was changed after it was registered.
    Interrupted
        If it is stopped from the keyboard; its `result` is a `FolderResult`. The same call
        continues from there.

    Examples
    --------
    >>> registration = rh.registration.ScanRegistration()  # doctest: +SKIP
    >>> rh.registration.register_folder(registration, "scans", "bodies")  # doctest: +SKIP
    """
    if same_person:
        check_unclothed(registration)
        if sequence:
            raise ArgumentError("sequence and same_person cannot both be True")
    files = _scan_files(scans)
    folder = file_path(output, "output", "folder")
    with convert_errors(folder, "cannot be made"):
        folder.mkdir(exist_ok=True)
        (folder / RECORDS).mkdir(exist_ok=True)
    complete = _read_output(folder, {file.stem for file in files})
    identity = _identity(registration, sequence, keep_axes)
    records: list[ScanRecord] = []
    before: RegisteredScan | None = None
    transform = np.eye(4) if keep_axes else None
    if same_person:
        digests = [hashlib.sha256(identity + read_bytes(file)).digest() for file in files]
        together = hashlib.sha256(b"".join(digests)).digest()
        keys = [hashlib.sha256(together + digest).hexdigest() for digest in digests]
        named = [(file.stem, key) for file, key in zip(files, keys, strict=True)]
        if all(name in complete for name in named):
            return [complete[name] for name in named]
        with interruptible(lambda inner: FolderResult(records=())):
            records = _register_person(registration, files, progress=progress)
            for file_record, key in zip(records, keys, strict=True):
                _write(folder, file_record, key, transform)
        return records
    with interruptible(lambda inner: FolderResult(records=tuple(records))):
        for file in tqdm(files, desc="Scans", unit="scan", disable=not progress):
            key = hashlib.sha256(identity + read_bytes(file)).hexdigest()
            record = complete.get((file.stem, key))
            is_new = record is None
            if record is None:
                record, before = _register_file(registration, file, before if sequence else None)
            else:
                before = None
            if sequence and transform is None:
                transform = record.arrays.get("transform")
            if is_new:
                _write(folder, record, key, transform)
            records.append(record)
    return records


def _scan_files(folder: str | os.PathLike[str]) -> list[Path]:
    """Return the files of scans in a folder, in the natural order of their names."""
    place = existing_folder(folder)
    files = visible_files(place, *POINT_SUFFIXES)
    files.sort(key=lambda file: natural_key(file.name))
    if not files:
        raise FileError(f"{place} holds no scans; they end in {', '.join(POINT_SUFFIXES)}")
    for first, second in pairwise(files):
        if first.stem == second.stem:
            raise FileError(f"{first.name} and {second.name} would both become {first.stem}.ply")
    return files


def read_records(folder: str | os.PathLike[str]) -> list[ScanRecord]:
    """Return the records of a folder, untrusted ones first, then those farthest from their scans.

    Parameters
    ----------
    folder : path_like
        The output of `register_folder`.

    Raises
    ------
    FileError
        If there are no records, or if a body was changed after it was registered.

    Examples
    --------
    >>> records = rh.registration.read_records("bodies")  # doctest: +SKIP
    """
    place = existing_folder(folder) / RECORDS
    files = visible_files(place, ".npz") if place.is_dir() else []
    if not files:
        raise FileError(
            f"{folder} holds no registered scans; to register scans, run riemhuman register "
            f"SCANS -o {folder}"
        )
    records = []
    for file in files:
        record = _read(file)
        body = _body_file(place.parent, record)
        if record.arrays and body.is_file():
            _check_unchanged(body, str(load_arrays(file, ["digest"], [])["digest"]))
        records.append(record)
    return sorted(
        records,
        key=lambda record: (
            record.trusted,
            bool(record.arrays),
            not record.message,
            -np.nan_to_num(record.median_distance),
            natural_key(record.name),
        ),
    )


def _register_file(
    registration: ScanRegistration, file: Path, before: RegisteredScan | None
) -> tuple[ScanRecord, RegisteredScan | None]:
    try:
        scan = load_scan(file, registration.unit)
        result = registration.solve(scan, start=before)
    except RiemhumanError as error:
        return _failed(file, error), None
    return record_of(file.stem, result), result if result.trusted else None


def _register_person(
    registration: ScanRegistration, files: list[Path], *, progress: bool
) -> list[ScanRecord]:
    """Return the records of scans of one person, registered together, in order."""
    records: dict[str, ScanRecord] = {}
    results: dict[str, RegisteredScan] = {}
    for file in tqdm(files, desc="Scans", unit="scan", disable=not progress):
        try:
            scan = load_scan(file, registration.unit)
            results[file.stem] = registration.solve(scan, trace=True)
        except RiemhumanError as error:
            records[file.stem] = _failed(file, error)
    for name, result in zip(results, share_person([*results.values()]), strict=True):
        records[name] = record_of(name, result)
    return [records[file.stem] for file in files]


def _failed(file: Path, error: RiemhumanError) -> ScanRecord:
    return ScanRecord(file.stem, False, str(error), np.nan, np.nan, 0.0, {})


def record_of(name: str, result: RegisteredScan) -> ScanRecord:
    """Return the record of a result, with some points of its scan."""
    scan = result.scan
    seen = np.flatnonzero(~result.background)
    shown = seen[even_points(scan.points[seen], _N_SHOWN)]
    arrays = {
        "points": result.points,
        "up": result.up,
        "transform": result.transform,
        "matched": result.matched,
        "trusted_vertices": result.trusted_vertices,
        "faces": result.faces,
        "shown": scan.points[shown].astype(np.float32),
        "shown_distances": result.distances[shown].astype(np.float32),
    }
    fit = result.fit
    if fit is not None:
        arrays |= {"betas": fit.betas, "pose": fit.pose, "trans": fit.trans}
        if fit.hands is not None:
            arrays["hands"] = fit.hands
    return ScanRecord(
        name=name,
        trusted=result.trusted,
        message=result.message,
        likelihood=result.likelihood,
        median_distance=float(np.median(result.distances[seen])),
        matched_share=share_of_surface(result.points, result.faces, result.matched),
        arrays=arrays,
    )


def _identity(registration: ScanRegistration, sequence: bool, keep_axes: bool) -> bytes:
    """Return a digest of what a registration depends on beside the scan."""
    options = (
        _VERSION,
        registration.unit,
        registration.up,
        registration.clothed,
        registration.settings,
        sequence,
        keep_axes,
    )
    model = registration.model
    parts = [model.template.vertices, model.parents, model]
    return hashlib.sha256(repr([options, *map(describe, parts)]).encode()).digest()


def _body_file(folder: Path, record: ScanRecord) -> Path:
    """Return where the body of a record is written; a trusted one with a message is partial."""
    place = folder / PARTIAL if record.message else folder
    return (place if record.trusted else folder / UNTRUSTED) / f"{record.name}.ply"


def _read_output(folder: Path, names: set[str]) -> dict[tuple[str, str], ScanRecord]:
    """Return records of scans whose files are complete, by name and key; refuse changed bodies."""
    complete = {}
    for file in sorted((folder / RECORDS).glob("*.npz")):
        try:
            record = _read(file)
            saved = load_arrays(file, ["key", "digest"], [])
        except FileFormatError:
            continue  # damaged: the scan is registered again
        if record.arrays:
            body = _body_file(folder, record)
            if not body.is_file():
                continue
            _check_unchanged(body, str(saved["digest"]))
        complete[record.name, str(saved["key"])] = record
    gone = [
        complete_record.name
        for complete_record in complete.values()
        if complete_record.arrays and complete_record.name not in names
    ]
    if gone:
        warn(f"{folder} holds bodies whose scans no longer exist: {', '.join(gone)}", UserWarning)
    return complete


def _check_unchanged(body: Path, digest: str) -> None:
    """Raise an error if a body is no longer that of its record."""
    if hashlib.sha256(read_bytes(body)).hexdigest() != digest:
        raise FileError(
            f"{body} was changed after it was registered; to register its scan again, or to "
            "measure it as it is, move the body elsewhere"
        )


def _write(folder: Path, record: ScanRecord, key: str, transform: Array | None) -> None:
    """Write the body, moved by a transform or its own, and then its record, which completes it."""
    for place in (folder, folder / PARTIAL, folder / UNTRUSTED):
        (place / f"{record.name}.ply").unlink(missing_ok=True)
    digest = ""
    if record.arrays:
        body = _body_file(folder, record)
        body.parent.mkdir(exist_ok=True)
        motion = record.arrays["transform"] if transform is None else transform
        points = apply_transform(motion, record.arrays["points"])
        save_mesh(body, points, record.arrays["faces"], record.arrays["trusted_vertices"])
        digest = hashlib.sha256(read_bytes(body)).hexdigest()
    fields = {
        "key": np.array(key),
        "digest": np.array(digest),
        "trusted": np.array(record.trusted),
        "message": np.array(record.message),
        "likelihood": np.array(record.likelihood),
        "median_distance": np.array(record.median_distance),
        "matched_share": np.array(record.matched_share),
    }
    file = folder / RECORDS / f"{record.name}.npz"
    save_arrays(file, {**fields, **record.arrays}, compressed=True)


def _read(file: Path) -> ScanRecord:
    fields = load_arrays(file, [*_FIELDS], _ARRAYS)
    for name, kind in _FIELDS.items():
        if fields[name].shape or fields[name].dtype.kind != kind:
            raise FileFormatError(f"{file}: {name} must be a single value, not {fields[name]!r}")
    for name in ("points", "shown"):
        try:
            real_array(fields.get(name, np.empty((0, 3))), name, ("n", 3), batched=False)
        except RiemhumanError as error:
            raise FileFormatError(f"{file}: {error}") from error
    return ScanRecord(
        name=file.stem,
        trusted=bool(fields["trusted"]),
        message=str(fields["message"]),
        likelihood=float(fields["likelihood"]),
        median_distance=float(fields["median_distance"]),
        matched_share=float(fields["matched_share"]),
        arrays={name: fields[name] for name in _ARRAYS if name in fields},
    )
