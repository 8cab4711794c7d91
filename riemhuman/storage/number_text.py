"""Numbers and words in text files.

Python reads ``1_0`` as ten, digits of every script, and ends lines where Unicode does; the formats
of this library know ASCII numbers, and the three line ends of text files.
"""

from __future__ import annotations

from pathlib import Path

from riemhuman.errors import FileFormatError
from riemhuman.storage.file_content import file_content


def real_field(word: bytes) -> float:
    """Return the real number that a word of a file spells.

    Parameters
    ----------
    word : bytes
        The word.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If it spells none.
    """
    if b"_" in word:
        raise ValueError
    return float(word)


def whole_field(word: bytes) -> int:
    """Return the whole number that a word of a file spells.

    Parameters
    ----------
    word : bytes
        The word.

    Returns
    -------
    int

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

    Returns
    -------
    str

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
