"""Outputs of commands, which are checked before the work begins and written atomically."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from riemhuman.errors import FileError, warn
from riemhuman.io.files import (
    check_replaceable,
    convert_errors,
    is_of_system,
    keep_permissions,
    lock_file,
    neighbour,
    suffix_of,
)
from riemhuman.representation import join_names

_REPLACED, _LOCK = ".replaced", ".lock"
_ATTEMPTS = 3
_NO_WORKING_FOLDER = "cannot be written: the working folder exists no longer"
# The lock of a hidden name by `neighbour`: .NAME.<eight hexadecimal digits>.part[.ENDING].lock
_LOCK_NAME = re.compile(r"\..+\.[0-9a-f]{8}\.part(\.[^.]*)?\.lock")


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
def files_together(places: Mapping[str, Path]) -> Iterator[dict[str, Path]]:
    """Yield other places for files, which move to theirs when all are written, or not at all.

    What killed processes have left beside the files is removed.
    """
    targets = {name: Path(os.path.realpath(place)) for name, place in places.items()}
    with ExitStack() as stack:
        folders = {
            parent: stack.enter_context(_hidden_folder(parent, targets.values()))
            for parent in {target.parent for target in targets.values()}
        }
        hidden = {name: folders[target.parent] / target.name for name, target in targets.items()}
        try:
            yield hidden
        except FileError as error:
            raise _at(error, {file: places[name] for name, file in hidden.items()}) from error
        written = {name: file for name, file in hidden.items() if file.exists()}
        earlier = {}
        for name, file in written.items():
            if targets[name].exists():
                with convert_errors(places[name]):
                    keep_permissions(targets[name], file)
                    if len(written) > 1:  # a single one takes its place or does not
                        earlier[name] = _kept(targets[name], neighbour(file))
        # After an error or an interruption, all files that were there.
        with ExitStack() as way_back:
            for name, file in written.items():
                if len(written) > 1:
                    way_back.callback(_return, earlier.get(name), targets[name], file)
                with convert_errors(places[name]):
                    os.replace(file, targets[name])
            way_back.pop_all()


def _kept(file: Path, copy: Path) -> Path:
    """Return a second name of a file, or a copy."""
    try:
        os.link(file, copy)
    except OSError:  # disks without links, and files that may have no others
        shutil.copy2(file, copy)
    return copy


def _return(earlier: Path | None, target: Path, written: Path) -> None:
    """Put back what a written file has replaced, or nothing."""
    if written.exists():
        return  # it has replaced nothing
    with suppress(OSError):  # the error that led here is the one to see
        if earlier is None:
            target.unlink()
        else:
            os.replace(earlier, target)


def _at(error: FileError, places: Mapping[Path, Path]) -> FileError:
    """Return an error that names places instead of hidden ones."""
    text = str(error)
    for hidden, place in places.items():
        text = text.replace(str(hidden), str(place))
    return FileError(text)


@contextmanager
def _hidden_folder(parent: Path, targets: Iterable[Path]) -> Iterator[Path]:
    """Yield an empty folder beside files, for what is to replace them."""
    first = next(target for target in targets if target.parent == parent)
    with convert_errors(first):
        _clean_up(parent)
    with _locked_neighbour(first) as temporary:
        try:
            with convert_errors(first):
                temporary.mkdir()
            yield temporary
        finally:
            shutil.rmtree(temporary, ignore_errors=True)


@contextmanager
def atomic_folder(path: Path, content: FolderContent | None = None) -> Iterator[Path]:
    """Yield a temporary folder, which then replaces an earlier result or, without content, nothing.

    What killed processes have left beside the folder is removed, and folders that they were about
    to replace are put back.
    """
    with convert_errors(path, _NO_WORKING_FOLDER):
        path = Path(os.path.abspath(path))
    with convert_errors(path):
        _clean_up(path.parent)
        with _locked_neighbour(path) as temporary:
            # Under its name in a hidden folder, so that any process can put it back.
            hidden = temporary.with_name(temporary.name + _REPLACED)
            try:
                temporary.mkdir()
                try:
                    yield temporary
                except FileError as error:
                    raise _at(error, {temporary: path}) from error
                if path.exists():
                    _check_content(path, content)
                    keep_permissions(path, temporary)
                    hidden.mkdir()
                    os.rename(path, hidden / path.name)
                os.rename(temporary, path)
            finally:
                # After an error or an interruption, the folder that was there.
                _put_back(hidden, path.parent)
                for folder in (temporary, hidden):
                    shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def _locked_neighbour(path: Path) -> Iterator[Path]:
    """Yield a hidden name that others leave alone as long as this process lives.

    Some network folders have no locks. There, names have none, and nobody cleans up.
    """
    with ExitStack() as stack:
        for _ in range(_ATTEMPTS):
            temporary = neighbour(path)
            lock = temporary.with_name(temporary.name + _LOCK)
            try:
                stack.enter_context(lock_file(lock, f"{path} cannot be written: {lock} is in use"))
                break
            except FileError:  # a process that cleans up was faster, or there are no locks
                with suppress(OSError):
                    lock.unlink()
        else:
            temporary = neighbour(path)
        yield temporary


def _clean_up(parent: Path) -> None:
    """Remove what writers in a folder left when they were killed; put back what they moved."""
    for lock in sorted(parent.glob(f".*{_LOCK}")):
        if not _LOCK_NAME.fullmatch(lock.name):
            continue
        temporary = lock.with_name(lock.name.removesuffix(_LOCK))
        hidden = temporary.with_name(temporary.name + _REPLACED)
        try:
            with lock_file(lock, "in use"):
                returned = _put_back(hidden, parent)
                leftovers = [folder for folder in (temporary, hidden) if folder.exists()]
                for folder in leftovers:
                    shutil.rmtree(folder, ignore_errors=True)
        except FileError:
            continue  # its writer is at work
        if leftovers:
            names = join_names([folder.name for folder in leftovers])
            warn(
                f"removed files that a killed process had left in {parent}: {names}",
                UserWarning,
            )
        if returned:
            warn(
                f"put back what a killed process was about to replace in {parent}: "
                f"{join_names(returned)}",
                UserWarning,
            )


def _put_back(hidden: Path, parent: Path) -> list[str]:
    """Move folders back to where they were, unless others have taken their places."""
    returned = []
    for folder in sorted(hidden.iterdir()) if hidden.is_dir() else ():
        if not os.path.lexists(parent / folder.name):
            os.rename(folder, parent / folder.name)
            returned.append(folder.name)
    return returned


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
    with convert_errors(path, _NO_WORKING_FOLDER):
        parent = Path(os.path.abspath(path)).parent
    if not parent.is_dir():
        if parent.exists():
            raise FileError(f"{path} cannot be written: {parent} is a file, not a folder")
        raise FileError(f"there is no folder {parent}; make it first: mkdir -p '{parent}'")
    if not os.access(parent, os.W_OK | os.X_OK):
        raise FileError(f"{path} cannot be written: no permission in {parent}; name another place")
