"""Numbers and words in text files.

Python reads ``1_0`` as ten, accepts digits of every script and ends lines where Unicode does. The
file formats of the library have ASCII numbers and the three line ends of text files.
"""

from __future__ import annotations

from pathlib import Path

from riemhuman.errors import FileFormatError
from riemhuman.storage.file_content import file_content


def real_field(word: bytes) -> float:
    """Return a word of a file as a real number.

    Parameters
    ----------
    word : bytes
        The word.

    Raises
    ------
    ValueError
        If it spells none.
    """
    if b"_" in word:
        raise ValueError
    return float(word)


def whole_field(word: bytes) -> int:
    """Return a word of a file as a whole number.

    Parameters
    ----------
    word : bytes
        The word.

    Raises
    ------
    ValueError
        If it spells none.
    """
    if b"_" in word:
        raise ValueError
    return int(word)


def text_content(file: Path) -> str:
    """Read a file of text in UTF-8, with or without a byte order mark.

    Parameters
    ----------
    file : Path
        The file.

    Raises
    ------
    FileError
        If it is missing, a folder, a device or a pipe, or cannot be read.
    FileFormatError
        If it is in another encoding.
    """
    try:
        return file_content(file).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{file} is not text in UTF-8: {error}") from error
