"""Errors and warnings: every error that the library raises is a `RiemhumanError`.

Each class also derives from the corresponding built-in exception, so that ``except ValueError``
around a wrong argument and ``except OSError`` around a missing file work.
"""

import sys
import warnings

# The longest text of an argument in a message.
_LONGEST = 200


class RiemhumanError(Exception):
    """Base class of all errors that the library raises.

    Examples
    --------
    >>> try:
    ...     rh.load_mesh("missing.ply")
    ... except rh.RiemhumanError as error:
    ...     print(error)
    there is no file missing.ply
    """


class ArgumentError(RiemhumanError, ValueError):
    """An argument has the wrong shape, range or content."""


class ArgumentTypeError(RiemhumanError, TypeError):
    """An argument has the wrong type."""


class UnknownNameError(ArgumentError, KeyError):
    """There is no measurement, landmark, part or joint of a name."""

    __str__ = Exception.__str__  # that of KeyError quotes the message


class DegenerateSurfaceError(ArgumentError):
    """A triangle has no area where the metric g must be invertible or a normal must exist."""


class NotDefinedError(RiemhumanError, NotImplementedError):
    """An operation has no closed form on this space, and no solver was given for it."""


class OutsideManifoldError(RiemhumanError, ValueError):
    """A geodesic leaves the manifold, or no minimising geodesic inside it exists."""


class FrameIndexError(RiemhumanError, IndexError):
    """An index is out of range: a motion has no such frame."""


class FileError(RiemhumanError, OSError):
    """A file or folder is missing or cannot be read or written."""


class FileFormatError(RiemhumanError, ValueError):
    """A file is damaged or has the wrong content."""


# MemoryError first: otherwise tblib, by which Dask sends errors, cannot make it again.
class OutOfMemoryError(MemoryError, RiemhumanError):
    """There is too little memory for a table, a sample or a job; the message says what to do."""


class MissingDependencyError(RiemhumanError, ImportError):
    """An optional dependency is not installed; the message names the extra that installs it."""


class ConvergenceWarning(UserWarning):
    """A solver stopped before it converged; the message of its result says why.

    Examples
    --------
    >>> import warnings
    >>> warnings.simplefilter("error", rh.ConvergenceWarning)  # not converging becomes an error
    """


class StretchInvarianceWarning(UserWarning):
    """A mean is computed with a metric that ignores the edge lengths of surfaces."""


class ReparametrizationInvarianceWarning(UserWarning):
    """A path over all vertices is sought under a metric that ignores motions along surfaces."""


class SeamWarning(UserWarning):
    """Vertices duplicated along a seam are moved separately, so the surface will tear.

    Examples
    --------
    >>> import warnings
    >>> warnings.simplefilter("error", rh.SeamWarning)  # torn surfaces become an error
    """


class MixedPosesWarning(UserWarning):
    """Principal components are computed from surfaces in several poses.

    Examples
    --------
    >>> import warnings
    >>> warnings.simplefilter("ignore", rh.MixedPosesWarning)  # poses are meant to vary
    """


class PrecisionWarning(UserWarning):
    """Coordinates keep few digits of the shape, as in single precision far from the origin.

    Examples
    --------
    >>> import warnings
    >>> warnings.simplefilter("error", rh.PrecisionWarning)  # few digits become an error
    """


class ClusterError(RiemhumanError, RuntimeError):
    """A cluster cannot continue its work."""


def warn(message: str, category: type[Warning]) -> None:
    """Issue a warning that points at the line of the user's code that caused it."""
    frame, level = sys._getframe(), 1
    while frame.f_back and _is_between(frame.f_globals.get("__name__", "")):
        frame, level = frame.f_back, level + 1
    warnings.warn(message, category, stacklevel=level)


def _is_between(module: str) -> bool:
    """Return whether a module is between the user's line and a warning."""
    # Functions that context managers decorate are called by contextlib, cached properties by
    # functools.
    return module.startswith("riemhuman.") or module in ("contextlib", "functools")


def counted(count: int, one: str, many: str) -> str:
    """Return a number with its noun, as in "1 mesh" or "2,000 meshes"."""
    return f"{count:,} {one if count == 1 else many}"


def shown(value: object) -> str:
    """Return the text of an argument, cut short because texts in files may have any length."""
    text = repr(value)
    return text if len(text) <= _LONGEST else text[: _LONGEST - 3] + "..."
