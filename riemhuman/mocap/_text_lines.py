"""Lines of recordings that are text, and errors that name a line."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from riemhuman.errors import FileFormatError
from riemhuman.io.files import read_bytes, short_message

LARGEST = 1e9
"""Larger numbers are damage: double precision holds such an angle to few digits."""


class TextLines:
    """The lines of a file; each loop goes on where the one before it ended."""

    def __init__(self, file: Path) -> None:
        self.file, self.number = file, 0
        self._lines = iter(read_bytes(file).decode("utf-8-sig", errors="replace").splitlines())

    def __iter__(self) -> Iterator[str]:
        for line in self._lines:
            self.number += 1
            yield line

    def error(self, problem: str) -> FileFormatError:
        """Return an error that names the latest line."""
        return FileFormatError(f"{self.file}, line {self.number}: {problem}")

    def floats(self, words: Iterable[str], what: str = "") -> list[float]:
        """Return words as numbers; `what` they are begins the message if they are none."""
        try:
            return [float(word) for word in words]
        except ValueError as error:
            raise self.error(f"{what} {short_message(error)}".lstrip()) from None

    def finite(self, words: Iterable[str], what: str = "") -> list[float]:
        """Return words as finite numbers."""
        numbers = self.floats(words, what)
        if not all(-LARGEST < number < LARGEST for number in numbers):
            start = f"{what} every" if what else "every"
            raise self.error(f"{start} number must be finite, and below {LARGEST:g}")
        return numbers
