"""Registration of metrics, descriptors, readers and measurements of other packages.

A package names them in its setup.cfg,

.. code-block:: ini

    [options.entry_points]
    riemhuman.metrics =
        vertex offsets = their_package:VertexOffsets
    riemhuman.descriptors =
        girths = their_package:Girths
    riemhuman.readers =
        caesar = their_package:load_caesar
    riemhuman.measurements =
        arm span = their_package:ArmSpan

and a script calls `register`. In both cases tables, the report and the options ``--metric`` and
``--reader`` of the command line find them, and measurements are taken with those of the library.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import entry_points
from typing import Any, TypeAlias

from riemhuman.checks import checked, choice
from riemhuman.errors import ArgumentError, ArgumentTypeError

KINDS = {
    "metrics": "called with an `AlignedSurfaces`, returns a metric on it",
    "descriptors": "called without arguments, returns one like `riemhuman.descriptors.Descriptor`",
    "readers": "called with a folder or file, returns what `testing.check_dataset` accepts",
    "measurements": "called without arguments, returns a `riemhuman.measurements.Measurement`",
}
"""Kinds of extensions, and how each is called."""

Factory: TypeAlias = Callable[..., Any]  # type: ignore[explicit-any]  # a signature for each kind
"""A class or function, called and returning as `KINDS` says of its kind."""

_REGISTERED: dict[str, dict[str, Factory]] = {kind: {} for kind in KINDS}


@checked(kind=choice(*KINDS))
def register(kind: str, name: str, factory: Factory) -> None:
    """Register a metric, descriptor, reader or measurement in this process.

    Parameters
    ----------
    kind : str
        One of `KINDS`, which says how each is called.
    name : str
        Its name in tables and on the command line.
    factory : callable
        A class or function.

    Examples
    --------
    >>> make = lambda space: rh.ElasticMetric(space, 1.0, 1.0, 0.0)
    >>> rh.extensions.register("metrics", "stretch", make)  # doctest: +SKIP
    >>> list(rh.extensions.extensions("metrics"))  # doctest: +SKIP
    ['stretch']
    """
    if not callable(factory):
        raise ArgumentTypeError(f"factory must be {KINDS[kind]}; found {type(factory).__name__}")
    known = extensions(kind)
    if name in known and known[name] is not factory:
        raise ArgumentError(f"name must not be in use among the {kind}; {name!r} is taken")
    _REGISTERED[kind][name] = factory


@checked(kind=choice(*KINDS))
def extensions(kind: str) -> dict[str, Factory]:
    """Return the extensions of installed packages and of this process by name.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    """
    factories: dict[str, Factory] = {}
    for entry in entry_points(group=f"riemhuman.{kind}"):
        try:
            factories[entry.name] = entry.load()
        except Exception as error:
            raise ArgumentError(
                f"the {kind} of installed packages include {entry.name!r}, {entry.value}, which "
                f"cannot be loaded: {type(error).__name__}: {error}"
            ) from error
    return factories | _REGISTERED[kind]


def extension(kind: str, name: str) -> Factory:
    """Return an extension of an installed package or of this process.

    Parameters
    ----------
    kind, name : str
        See `register`.
    """
    known = extensions(kind)
    if name not in known:
        listed = ", ".join(map(repr, known)) or "none"
        raise ArgumentError(f"{name!r} is not among the {kind} that packages register: {listed}")
    return known[name]
