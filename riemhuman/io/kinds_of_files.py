"""What can be done with files of each kind: a row that every reader declares beside itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

_Reader = TypeVar("_Reader", bound=Callable[..., object])

YES = "yes"
BY_MAP = "`TopologyMap`"
BY_SCAN = "`ScanRegistration`"
BY_DEFINITIONS = "with `--definitions`"
AFTER = "once registered"

_KINDS: dict[str, FileKind] = {}


@dataclass(frozen=True)
class FileKind:
    """What can be done with files of one kind.

    Attributes
    ----------
    name : str
        What the files are.
    reader : callable
    reader_name : str
        Its public name in `riemhuman`.
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

    Examples
    --------
    >>> [kind.endings for kind in rh.io.file_kinds() if kind.name == "AMASS"]
    [('.npz',)]
    """

    name: str
    reader: Callable[..., object]
    reader_name: str
    endings: tuple[str, ...]
    registered: str
    measured: str
    is_motion: bool
    written: tuple[str, ...]


def reads(
    name: str,
    reader_name: str,
    endings: tuple[str, ...],
    *,
    registered: str,
    measured: str,
    is_motion: bool = False,
    written: tuple[str, ...] = (),
) -> Callable[[_Reader], _Reader]:
    """Declare which files a reader reads, for `file_kinds` and ``riemhuman formats``.

    A reader of your own appears there once its module is imported.

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

    Returns
    -------
    callable
        A decorator, which returns the reader unchanged.

    Examples
    --------
    >>> own = rh.io.reads("files of my scanner", "my_package.load", (".bin",),
    ...                   registered="`ScanRegistration`", measured="once registered")
    >>> load = own(np.fromfile)  # doctest: +SKIP
    """

    def declare(reader: _Reader) -> _Reader:
        _KINDS[name] = FileKind(
            name, reader, reader_name, endings, registered, measured, is_motion, written
        )
        return reader

    return declare


def file_kinds() -> tuple[FileKind, ...]:
    """Return the kinds of files that the readers imported so far declare, by name.

    Examples
    --------
    >>> any(kind.is_motion for kind in rh.io.file_kinds())
    True
    """
    return tuple(sorted(_KINDS.values(), key=lambda kind: kind.name.lower()))
