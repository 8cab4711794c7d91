"""The command ``formats``: what can be done with each kind of file, by its reader."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import riemhuman as rh
from riemhuman.cli import _commands as cli

_IS = "yes"
_BY_MAP = "`TopologyMap`"
_BY_DEFINITIONS = "with `--definitions`"
_BY_SCAN = "`ScanRegistration`"
_AFTER = "once registered"
_TITLES = ("I have", "endings", "read by", "registered", "measured", "motions", "written back")


@dataclass(frozen=True)
class FileKind:
    """What can be done with files of one kind.

    ``registered`` says what puts them into correspondence, ``measured`` when girths and lengths are
    known; ``is_motion``, whether the reader returns motions; ``written``, to which endings.
    """

    name: str
    reader: Callable[..., Any]
    reader_name: str
    endings: tuple[str, ...]
    registered: str
    measured: str
    is_motion: bool
    written: tuple[str, ...]

    def cells(self) -> tuple[str, ...]:
        """Return the row of the table."""
        return (
            self.name,
            " ".join(self.endings),
            f"`{self.reader_name}`",
            self.registered,
            self.measured,
            _IS if self.is_motion else "",
            " ".join(self.written),
        )


def file_kinds() -> tuple[FileKind, ...]:
    """Return all kinds, with the endings that their readers and writers declare."""
    from riemhuman.datasets.motions import WRITTEN_MOTIONS
    from riemhuman.datasets.recordings import RECORDING_ENDINGS
    from riemhuman.datasets.registered_meshes import MESH_ENDINGS
    from riemhuman.io.meshes import MESH_SUFFIXES, POINT_SUFFIXES, WRITTEN_SUFFIXES

    return (
        FileKind(
            "meshes of one topology, not the open model's",
            rh.datasets.load_bodies,
            "datasets.load_bodies",
            MESH_ENDINGS,
            _IS,
            _BY_MAP,
            False,
            WRITTEN_SUFFIXES,
        ),
        FileKind(
            "MPI FAUST",
            rh.datasets.load_faust,
            "datasets.load_faust",
            (".ply",),
            _IS,
            _BY_MAP,
            False,
            WRITTEN_SUFFIXES,
        ),
        FileKind(
            "a mesh of SMPL, SMPL-X, MHR, Anny or another topology",
            rh.load_mesh,
            "load_mesh",
            MESH_SUFFIXES,
            _BY_MAP,
            _AFTER,
            False,
            WRITTEN_SUFFIXES,
        ),
        FileKind(
            "a raw scan",
            rh.registration.load_scan,
            "registration.load_scan",
            POINT_SUFFIXES,
            _BY_SCAN,
            _AFTER,
            False,
            WRITTEN_SUFFIXES,
        ),
        FileKind(
            "bodies of SAM 3D Body, with `faces=`",
            rh.datasets.load_photographed_bodies,
            "datasets.load_photographed_bodies",
            (".npz",),
            _BY_MAP,
            _AFTER,
            False,
            WRITTEN_SUFFIXES,
        ),
        FileKind(
            "AMASS",
            rh.datasets.load_amass,
            "datasets.load_amass",
            (".npz",),
            _IS,
            _IS,
            True,
            WRITTEN_MOTIONS,
        ),
        FileKind(
            "Dynamic FAUST",
            rh.datasets.load_dfaust,
            "datasets.load_dfaust",
            (".hdf5", ".h5"),
            _IS,
            _BY_MAP,
            True,
            (".glb",),
        ),
        FileKind(
            "skeletons, markers, and people in videos",
            rh.datasets.load_recording,
            "datasets.load_recording",
            RECORDING_ENDINGS,
            _IS,
            _IS,
            True,
            WRITTEN_MOTIONS,
        ),
        FileKind(
            "a folder of folders of meshes, one a motion",
            rh.datasets.load_mesh_motions,
            "datasets.load_mesh_motions",
            MESH_ENDINGS,
            _IS,
            _BY_MAP,
            True,
            (".glb",),
        ),
        FileKind(
            "models: SMPL, SMPL-H, SMPL-X, STAR, SMAL",
            rh.BodyModel.from_file,
            "BodyModel.from_file",
            (".npz", ".pkl", ".pickle"),
            _IS,
            _BY_DEFINITIONS,
            False,
            (".npz",),
        ),
    )


def format_table() -> str:
    """Return the table of all kinds of files, as Markdown."""
    rows = [_TITLES, ("---",) * len(_TITLES), *(kind.cells() for kind in file_kinds())]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


@cli.command(
    "formats",
    "what can be done with which files",
    "Prints a table of the files that are read: by which function, what registers them, whether\n"
    "they can be measured, whether they are motions, and how they are written back.",
    "  riemhuman formats\n  riemhuman formats --json\n",
)
def _formats(options: argparse.Namespace) -> cli.Answer:
    del options
    record = [dict(zip(_TITLES, kind.cells(), strict=True)) for kind in file_kinds()]
    return cli.Answer(format_table(), record)
