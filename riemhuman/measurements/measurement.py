"""What a measurement is: a small declarative object that JSON can hold.

A measurement knows landmarks, axes and parts by name; `riemhuman.measurements.MeasurementSet` says
where they are on a template.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, asdict, dataclass, fields
from typing import Any, ClassVar

from riemhuman.errors import ArgumentTypeError
from riemhuman.measurements.landmarks import LandmarkedBodies, Place


@dataclass(frozen=True, kw_only=True)
class Measurement:
    """The base class of measurements.

    Parameters
    ----------
    name : str
        Its name in tables.
    standard : str
        The standard that defines it, where there is one.
    note : str
        What is to be known about it.

    Examples
    --------
    >>> import riemhuman as rh
    >>> isinstance(rh.measurements.Height(name="stature", at="crown"), rh.measurements.Measurement)
    True
    """

    name: str
    standard: str = ""
    note: str = ""
    units: ClassVar[str] = "m"

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise ArgumentTypeError(f"name must be a text; found {self.name!r}")

    @property
    def places(self) -> tuple[Place, ...]:
        """Places it is taken at."""
        return ()

    @property
    def parts_named(self) -> tuple[str, ...]:
        """Parts of the body it refers to."""
        return ()

    def value(self, bodies: LandmarkedBodies) -> Any:
        """Return the values of bodies, differentiable by autograd.

        Parameters
        ----------
        bodies : LandmarkedBodies
            Bodies with landmarks.

        Returns
        -------
        array, shape (n,)
            NaN where it cannot be taken.
        """
        raise NotImplementedError

    def curves(self, bodies: LandmarkedBodies) -> list[Any]:
        """Return where the tape runs on the first of the bodies.

        Parameters
        ----------
        bodies : LandmarkedBodies
            Bodies with landmarks.

        Returns
        -------
        curves : list of array, shape (k, 3)
            Empty for volumes and areas.
        """
        return []

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON has it, with its kind.

        Returns
        -------
        dict
        """
        plain = {f.name: f.default for f in fields(self) if f.default is not MISSING}
        record = {k: v for k, v in asdict(self).items() if k not in plain or v != plain[k]}
        return {
            "kind": type(self).__name__,
            **{k: _listed(v) for k, v in record.items() if v != ()},
        }


def names_of_parts(value: Any, name: str) -> tuple[str, ...]:
    """Return a list of names as a tuple.

    Parameters
    ----------
    value : sequence of str
        The names.
    name : str
        Name of the argument, for messages.

    Returns
    -------
    tuple of str

    Raises
    ------
    ArgumentTypeError
        If it is a text, or holds anything but texts.
    """
    if isinstance(value, str) or not all(isinstance(part, str) for part in value):
        raise ArgumentTypeError(f"{name} must be a list of names; found {value!r}")
    return tuple(value)


def _listed(value: Any) -> Any:
    """Return tuples as lists, as JSON gives them back."""
    if isinstance(value, (tuple, list)):
        return [_listed(entry) for entry in value]
    return dict(value) if isinstance(value, Mapping) else value
