"""Locks on files and folders, which the system releases when their process ends.

Unlike those of filelock 4.2, they leave no file behind and refuse a file that holds something.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from riemhuman.errors import FileError
from riemhuman.storage.own_files import open_lock

if sys.platform == "win32":
    import msvcrt

    def lock(descriptor: int) -> None:
        """Lock an open file, or raise what the system says if another process has done so.

        Parameters
        ----------
        descriptor : int
            The file.

        Raises
        ------
        BlockingIOError
            If it is locked.
        """
        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        except OSError as error:
            raise BlockingIOError(error.errno, error.strerror) from error

else:
    import fcntl

    def lock(descriptor: int) -> None:
        """Lock an open file or folder, or raise what the system says if it is locked already.

        Parameters
        ----------
        descriptor : int
            The file.

        Raises
        ------
        BlockingIOError
            If it is locked.
        OSError
            If it cannot be locked, as on some network file systems.
        """
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


@contextmanager
def only_one(file: Path, busy: str) -> Iterator[None]:
    """Keep other processes out for as long as a lock file is held; it is removed in the end.

    Parameters
    ----------
    file : Path
        The lock file; that of a process that was killed is taken over.
    busy : str
        What to say to a process that is kept out.

    Yields
    ------
    None

    Raises
    ------
    FileError
        If another process holds it, or something else has this name.
    OSError
        If there can be no such file.
    """
    while True:
        descriptor = open_lock(file)
        try:
            lock(descriptor)
        except BlockingIOError as error:
            os.close(descriptor)
            raise FileError(busy) from error
        except BaseException:
            os.close(descriptor)
            raise
        if is_at(os.fstat(descriptor), file):
            break
        os.close(descriptor)  # removed by its holder between the opening and the locking
    try:
        yield
    finally:
        # Removed while it is held: later, it might be another process that holds it.
        with suppress(OSError):
            file.unlink()
        os.close(descriptor)


def is_at(found: os.stat_result, path: Path) -> bool:
    """Tell whether a file or folder is still the one at a path.

    Parameters
    ----------
    found : os.stat_result
        What the system said about it.
    path : Path
        Where it was.

    Returns
    -------
    bool
    """
    try:
        return os.path.samestat(found, path.stat(follow_symlinks=False))
    except OSError:
        return False
