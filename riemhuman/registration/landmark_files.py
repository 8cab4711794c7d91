"""Files of landmarks of a scan."""

from __future__ import annotations

import os

import numpy as np

from riemhuman.checks import real_array
from riemhuman.errors import ArgumentError, FileFormatError
from riemhuman.io.files import file_path
from riemhuman.io.text_tables import read_named_rows


def load_landmarks(path: str | os.PathLike[str]) -> dict[str, np.ndarray]:
    """Read landmarks of a scan for `ScanRegistration.solve`.

    Parameters
    ----------
    path : path_like
        A .csv file with a line ``name,x,y,z`` for each landmark: a joint of the body model, and its
        place in the scan, in the unit of the scan. A first line that begins with ``name`` is a
        header.

    Returns
    -------
    dict of str to array, shape (3,)

    Raises
    ------
    ArgumentTypeError
        If `path` is not a path.
    FileError
        If the file is missing or cannot be read.
    FileFormatError
        If a name is missing or repeated, or a line has no three finite numbers.

    Examples
    --------
    >>> import riemhuman as rh
    >>> with open("landmarks.csv", "w") as file:
    ...     print("left_wrist,0.62,1.31,0.05", file=file)
    >>> rh.registration.load_landmarks("landmarks.csv")["left_wrist"].tolist()
    [0.62, 1.31, 0.05]
    """
    file = file_path(path)
    rows = read_named_rows(file, "name")
    try:
        places = real_array(list(rows.values()), "landmarks", (len(rows), 3), batched=False)
    except ArgumentError as error:
        raise FileFormatError(f"{file}: {error}") from error
    return dict(zip(rows, places, strict=True))
