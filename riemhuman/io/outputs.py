"""Outputs of commands, which are checked before the work begins and appear when it is done."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from riemhuman.errors import FileError
from riemhuman.io.files import (
    check_replaceable,
    convert_errors,
    is_of_system,
    keep_permissions,
    neighbour,
    suffix_of,
)


@dataclass(frozen=True)
class FolderContent:
    """What a command writes into a folder: a pattern of names, and the name of a file among them.

    A folder without the latter is no earlier result, but perhaps files of the user's own, whose
    names may match: a folder of meshes, or of PDF files.
    """

    names: str
    always: str

    def holds(self, name: str) -> bool:
        return re.fullmatch(self.names, name) is not None


def check_output_file(path: Path, endings: Sequence[str], *, force: bool) -> None:
    """Raise an error if a file cannot be written after the work; with `force`, it may exist."""
    suffix_of(path, endings)
    if path.is_dir():
        raise FileError(
            f"{path} is a folder; name a file in it, such as {path / 'out'}{endings[0]}"
        )
    if os.path.lexists(path) and not force:
        raise FileError(f"{path} exists; --force replaces it")
    check_replaceable(path)
    check_parent(Path(os.path.realpath(path)) if path.is_symlink() else path)


def check_output_folder(path: Path, content: FolderContent, *, force: bool) -> None:
    """Raise an error if a folder could not be written after the work, see `atomic_folder`."""
    if path.is_symlink():
        raise FileError(f"{path} is a link; name a folder that does not exist yet")
    if path.exists():
        if not path.is_dir():
            raise FileError(f"{path} is a file; name a folder that does not exist yet")
        if _check_content(path, content) and not force:
            raise FileError(f"{path} holds an earlier result; --force replaces it")
    check_parent(path)


@contextmanager
def atomic_folder(path: Path, content: FolderContent | None = None) -> Iterator[Path]:
    """Yield a temporary folder, which then replaces an earlier result or, without content, nothing.

    A process that is killed leaves the earlier folder, or the new one.
    """
    path = Path(os.path.abspath(path))
    temporary = neighbour(path)
    with ExitStack() as stack, convert_errors(path):
        temporary.mkdir()
        stack.callback(shutil.rmtree, temporary, ignore_errors=True)
        try:
            yield temporary
        except FileError as error:
            # Errors name the place instead of the temporary one.
            raise FileError(str(error).replace(str(temporary), str(path))) from error
        if not path.exists():
            os.rename(temporary, path)
            return
        _check_content(path, content)
        keep_permissions(path, temporary)
        replaced = neighbour(path)
        os.rename(path, replaced)
        try:
            os.rename(temporary, path)
        except BaseException:  # an interruption, too, leaves the earlier folder
            os.rename(replaced, path)
            raise
        shutil.rmtree(replaced, ignore_errors=True)


def _check_content(path: Path, content: FolderContent | None) -> bool:
    """Return whether a folder holds files; raise an error if they are not an earlier result.

    What file managers add does not count.
    """
    with convert_errors(path, "cannot be read"):
        found = sorted(os.scandir(path), key=lambda entry: entry.name)
    entries = [entry for entry in found if not is_of_system(entry)]
    for entry in entries:
        is_ours = content is not None and content.holds(entry.name)
        if not (is_ours and entry.is_file(follow_symlinks=False)):
            raise FileError(
                f"{path} holds something else ({entry.name}); name a folder that does not exist yet"
            )
    if entries and content is not None and content.always not in (e.name for e in entries):
        raise FileError(
            f"{path} holds {entries[0].name}, but no {content.always}, so it is no earlier result; "
            "name a folder that does not exist yet"
        )
    return bool(entries)


def check_parent(path: Path) -> None:
    """Raise an error unless a file or folder can be made at a path."""
    parent = Path(os.path.abspath(path)).parent
    if not parent.is_dir():
        if parent.exists():
            raise FileError(f"{path} cannot be written: {parent} is a file, not a folder")
        raise FileError(f"there is no folder {parent}; make it first: mkdir -p '{parent}'")
    if not os.access(parent, os.W_OK | os.X_OK):
        raise FileError(f"{path} cannot be written: no permission in {parent}; name another place")
