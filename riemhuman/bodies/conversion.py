"""Conversion of body models to archives of plain arrays, which are safe to read."""

from __future__ import annotations

import os

from riemhuman.bodies.body_model import BodyModel


def convert_model(
    source: str | os.PathLike[str], target: str | os.PathLike[str], *, n_betas: int | None = None
) -> BodyModel:
    """Read a body model, check it, and write it as an .npz file in SMPL's layout.

    The new file holds only plain arrays: no pickled objects, no chumpy, no sparse matrices.

    Parameters
    ----------
    source : path_like
        A .pkl or .npz file, see `BodyModel.from_file`.
    target : path_like
        File to write, with its suffix; an existing file is replaced.
    n_betas : int, optional
        Number of shape coefficients to keep, as for `BodyModel.from_file`.

    Returns
    -------
    model : BodyModel
        The model in the new file.

    Raises
    ------
    ArgumentTypeError
        If a path is not a path or `n_betas` not a whole number.
    ArgumentError
        If `n_betas` is negative or more than the file has.
    FileError
        If a file is missing or cannot be read or written.
    FileFormatError
        If `source` does not hold a body model, or is a .pkl file with objects other than arrays.

    Examples
    --------
    >>> import riemhuman as rh
    >>> model = rh.datasets.load_open_model("coarse")
    >>> model.save("model.npz")
    >>> rh.bodies.convert_model("model.npz", "smaller.npz", n_betas=3).n_betas
    3
    """
    model = BodyModel.from_file(source, n_betas=n_betas)
    model.save(target)
    return model
