"""What a user may change about registration; the other constants are in `_constants`."""

from __future__ import annotations

from dataclasses import dataclass

from riemhuman.checks import checked, each, flag, instance, positive, whole

_name = instance(str, "the name of a start pose, such as 'a'")


@checked(
    poses=each(_name, "names of start poses"),
    n_headings=whole(minimum=1),
    tries_arms=flag,
    most_points=whole(minimum=200),
    last_stiffness=positive,
)
@dataclass(frozen=True)
class RegistrationSettings:
    """What may be changed about `ScanRegistration`: where it starts, and how close it gets.

    Attributes
    ----------
    poses : tuple of str, optional
        Names of the start poses; None means all that the model has. Fewer take less time.
    n_headings : int
        Headings from which each pose starts, evenly spread over 360°.
    tries_arms : bool
        Whether the arms of the most likely body are tried in other positions.
    most_points : int
        Number of points of a scan that are kept, evenly spread.
    last_stiffness : float
        Stiffness α of the elastic step at its end, for a scan with little noise. A larger one keeps
        the surface closer to the model.

    Examples
    --------
    >>> settings = rh.registration.RegistrationSettings(poses=("a", "t"), n_headings=8)
    >>> model = rh.datasets.load_open_model("coarse")
    >>> registration = rh.registration.ScanRegistration(model, settings=settings)
    """

    poses: tuple[str, ...] | None = None
    n_headings: int = 6
    tries_arms: bool = True
    most_points: int = 20_000
    last_stiffness: float = 2e-5


DEFAULT_SETTINGS = RegistrationSettings()
