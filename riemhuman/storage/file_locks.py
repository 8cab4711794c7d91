"""Locks on files and folders, which the system releases when their process ends.

Unlike the locks of filelock 4.2, they leave no file behind and refuse a file with content.
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
        """Lock an open file, or raise an error if another process has locked it.

        Parameters
        ----------
        descriptor : int
            The file.

        Raises
        ------
        BlockingIOError
            If another process has locked it.
        """
        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        except OSError as error:
            raise BlockingIOError(error.errno, error.strerror) from error

else:
    import fcntl

    def lock(descriptor: int) -> None:
        """Lock an open file or folder, or raise an error if another process has locked it.

        Parameters
        ----------
        descriptor : int
            The file or folder.

        Raises
        ------
        BlockingIOError
            If another process has locked it.
        OSError
            If it cannot be locked, as on some network file systems.
        """
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


@contextmanager
def only_one(file: Path, busy: str) -> Iterator[None]:
    """Hold a lock file, which keeps other processes out, and remove it in the end.

    Parameters
    ----------
    file : Path
        The lock file; the one of a killed process is reused.
    busy : str
        Message of the error if another process holds it.

    Raises
    ------
    FileError
        If another process holds it, or something else has this name.
    OSError
        If the file cannot be made.
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
    """Tell whether a path still leads to the same file or folder.

    Parameters
    ----------
    found : os.stat_result
        Status of the file or folder.
    path : Path
        The path.
    """
    try:
        return os.path.samestat(found, path.stat(follow_symlinks=False))
    except OSError:
        return False
