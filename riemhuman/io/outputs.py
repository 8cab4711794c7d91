"""Outputs of commands, which are checked before the work begins and written atomically."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from riemhuman.errors import FileError
from riemhuman.io.files import convert_errors, neighbour, suffix_of


def check_output_file(path: Path, endings: Sequence[str], *, force: bool) -> None:
    """Raise an error if a file cannot be written after the work; with `force`, it may exist."""
    suffix_of(path, endings)
    if path.is_dir():
        raise FileError(
            f"{path} is a folder; name a file in it, such as {path / 'out'}{endings[0]}"
        )
    if os.path.lexists(path) and not force:
        raise FileError(f"{path} exists; --force replaces it")
    _check_parent(path)


def check_output_folder(path: Path, is_ours: Callable[[str], bool], *, force: bool) -> None:
    """Raise an error if a folder could not be written after the work, see `atomic_folder`."""
    if path.is_symlink():
        raise FileError(f"{path} is a link; name a folder that does not exist yet")
    if path.exists():
        if not path.is_dir():
            raise FileError(f"{path} is a file; name a folder that does not exist yet")
        if _check_content(path, is_ours) and not force:
            raise FileError(f"{path} holds an earlier result; --force replaces it")
    _check_parent(path)


@contextmanager
def files_together(places: Mapping[str, Path]) -> Iterator[dict[str, Path]]:
    """Yield other places for files, which move to theirs when all are written, or not at all."""
    targets = {name: Path(os.path.realpath(place)) for name, place in places.items()}
    hidden = {name: neighbour(target) for name, target in targets.items()}
    try:
        yield hidden
        for name, file in hidden.items():
            if file.exists():
                with convert_errors(places[name]):
                    if targets[name].exists():
                        shutil.copymode(targets[name], file)
                    os.replace(file, targets[name])
    except FileError as error:
        text = str(error)
        for name, file in hidden.items():
            text = text.replace(str(file), str(places[name]))
        raise FileError(text) from error
    finally:
        for file in hidden.values():
            file.unlink(missing_ok=True)


@contextmanager
def atomic_folder(path: Path, is_ours: Callable[[str], bool]) -> Iterator[Path]:
    """Yield a temporary folder, which then replaces a folder that holds only our files."""
    path = Path(os.path.abspath(path))
    temporary, replaced = neighbour(path), neighbour(path)
    with convert_errors(path):
        try:
            temporary.mkdir()
            yield temporary
            if path.exists():
                _check_content(path, is_ours)
                shutil.copymode(path, temporary)
                os.rename(path, replaced)
            try:
                os.rename(temporary, path)
            except BaseException:
                if replaced.exists():
                    os.rename(replaced, path)
                raise
        finally:
            for folder in (temporary, replaced):
                shutil.rmtree(folder, ignore_errors=True)


def _check_content(path: Path, is_ours: Callable[[str], bool]) -> bool:
    """Return whether a folder holds files; raise an error if some are not the command's."""
    with convert_errors(path, "cannot be read"):
        entries = sorted(os.scandir(path), key=lambda entry: entry.name)
    for entry in entries:
        if not (is_ours(entry.name) and entry.is_file(follow_symlinks=False)):
            raise FileError(
                f"{path} holds something else ({entry.name}); name a folder that does not exist yet"
            )
    return bool(entries)


def _check_parent(path: Path) -> None:
    parent = Path(os.path.abspath(path)).parent
    if not parent.is_dir():
        if parent.exists():
            raise FileError(f"{path} cannot be written: {parent} is a file, not a folder")
        raise FileError(f"there is no folder {parent}; make it first: mkdir -p '{parent}'")
    if not os.access(parent, os.W_OK | os.X_OK):
        raise FileError(f"{path} cannot be written: no permission in {parent}; name another place")
