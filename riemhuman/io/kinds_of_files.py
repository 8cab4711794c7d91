"""What can be done with files of each kind: a row that every reader declares beside itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias, TypeVar

Reader: TypeAlias = Callable[..., object]  # type: ignore[explicit-any]  # of its own arguments

_Reader = TypeVar("_Reader", bound=Reader)

YES = "yes"
BY_MAP = "`TopologyMap`"
BY_SCAN = "`ScanRegistration`"
BY_DEFINITIONS = "with `--definitions`"
AFTER = "once registered"

KINDS: dict[str, FileKind] = {}
"""What readers have declared so far, by name."""


@dataclass(frozen=True)
class FileKind:
    """What can be done with files of one kind.

    Parameters
    ----------
    name : str
        What the files are.
    reader_name : str
        Name of the reader for the table.
    endings : tuple of str
        Endings that it reads.
    registered : str
        What puts the files into correspondence, or "yes".
    measured : str
        When girths and lengths are known.
    is_motion : bool
        Whether the reader returns motions.
    written : tuple of str
        Endings that what was read is written to.
    reader : callable, optional
        The reader, once it is declared by `reads`.

    Examples
    --------
    >>> [kind.endings for kind in rh.io.file_kinds() if kind.name == "AMASS"]
    [('.npz',)]
    """

    name: str
    reader_name: str
    endings: tuple[str, ...]
    registered: str
    measured: str
    is_motion: bool = False
    written: tuple[str, ...] = ()
    reader: Reader | None = None


def reads(kind: FileKind) -> Callable[[_Reader], _Reader]:
    """Declare which files a reader reads, for `file_kinds` and ``riemhuman formats``.

    A reader of your own appears there once its module is imported.

    Parameters
    ----------
    kind : FileKind

    Returns
    -------
    callable
        A decorator, which returns the reader unchanged.

    Examples
    --------
    >>> kind = rh.io.FileKind("files of my scanner", "my_package.load", (".bin",),
    ...                       registered="`ScanRegistration`", measured="once registered")
    >>> load = rh.io.reads(kind)(np.fromfile)  # doctest: +SKIP
    """

    def declare(reader: _Reader) -> _Reader:
        KINDS[kind.name] = replace(kind, reader=reader)
        return reader

    return declare


def file_kinds() -> tuple[FileKind, ...]:
    """Return the kinds of files that the readers imported so far declare, by name.

    Examples
    --------
    >>> any(kind.is_motion for kind in rh.io.file_kinds())
    True
    """
    return tuple(sorted(KINDS.values(), key=lambda kind: kind.name.lower()))
