"""The base class of measurements: records of parameters that JSON can hold.

A measurement refers to landmarks, axes and parts by name; a
`riemhuman.measurements.MeasurementSet` locates them on a template.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, asdict, dataclass, fields
from typing import Any, ClassVar

from riemhuman.docstrings import InheritsDocstrings
from riemhuman.errors import ArgumentTypeError
from riemhuman.measurements.landmarks import LandmarkedBodies, Place


@dataclass(frozen=True, kw_only=True)
class Measurement(InheritsDocstrings):
    """The base class of measurements.

    Parameters
    ----------
    name : str
        Name in tables.
    standard : str
        The standard that defines it, such as "ISO 8559-1".
    note : str
        A remark.

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
            raise ArgumentTypeError(f"name must be a non-empty string; found {self.name!r}")

    @property
    def places(self) -> tuple[Place, ...]:
        """Places that the measurement refers to."""
        return ()

    @property
    def parts_named(self) -> tuple[str, ...]:
        """Parts of the body that the measurement refers to."""
        return ()

    def value(self, bodies: LandmarkedBodies) -> Any:
        """Return the measurement of each body; autograd can differentiate it.

        Parameters
        ----------
        bodies : LandmarkedBodies
            The bodies.

        Returns
        -------
        array, shape (n,)
            NaN for bodies where the measurement is not defined.
        """
        raise NotImplementedError

    def curves(self, bodies: LandmarkedBodies) -> list[Any]:
        """Return the curves of the tape on the first body.

        Parameters
        ----------
        bodies : LandmarkedBodies
            The bodies.

        Returns
        -------
        curves : list of array, shape (k, 3)
            Empty for volumes and areas.
        """
        return []

    def to_dict(self) -> dict[str, Any]:
        """Return the record that JSON holds: the kind and the parameters without their defaults.

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
    """Return names of parts as a tuple.

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
        If the value is a string, or holds anything but strings.
    """
    if isinstance(value, str) or not all(isinstance(part, str) for part in value):
        raise ArgumentTypeError(f"{name} must be a list of names; found {value!r}")
    return tuple(value)


def _listed(value: Any) -> Any:
    """Return tuples as lists, as JSON reads them."""
    if isinstance(value, (tuple, list)):
        return [_listed(entry) for entry in value]
    return dict(value) if isinstance(value, Mapping) else value
