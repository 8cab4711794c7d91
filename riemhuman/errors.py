"""Typed errors: every refusal of the library is a `RiemhumanError`.

Each class also derives from the built-in exception people expect in its place, so that
``except ValueError`` around a wrong argument and ``except OSError`` around a missing file work.
"""


class RiemhumanError(Exception):
    """Base class of everything the library refuses to do.

    Examples
    --------
    >>> import riemhuman as rh
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


class DegenerateSurfaceError(ArgumentError):
    """A triangle has no area where the metric g must be invertible or a normal must exist."""


class NotDefinedError(RiemhumanError, NotImplementedError):
    """An operation has no closed form on this space and no strategy was injected for it."""


class OutsideManifoldError(RiemhumanError, ValueError):
    """A geodesic leaves the manifold, or no minimising geodesic inside it exists."""


class FrameIndexError(RiemhumanError, IndexError):
    """A sequence is asked for an item it does not have: a motion for a frame, bodies for one."""


class FileError(RiemhumanError, OSError):
    """A file or folder is missing or cannot be read or written."""


class FileFormatError(RiemhumanError, ValueError):
    """A file was read, but does not hold what it should."""


class MissingDependencyError(RiemhumanError, ImportError):
    """An optional dependency is not installed; the message names the extra that brings it."""


class ConvergenceWarning(UserWarning):
    """A solver stopped before it converged; its result says why.

    Examples
    --------
    >>> import warnings
    >>> import riemhuman as rh
    >>> warnings.simplefilter("error", rh.ConvergenceWarning)  # not converging becomes an error
    """


class DamagedFileWarning(UserWarning):
    """A file is not what was written to it; what was lost is computed again."""


class UnseenLengthsWarning(UserWarning):
    """A mean is sought by a metric that does not see how long the edges of a surface are."""


class ClusterError(RiemhumanError, RuntimeError):
    """A cluster that cannot go on with its work."""
