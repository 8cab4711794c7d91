"""All settings of registration, the tree that a user passes."""

from __future__ import annotations

from dataclasses import dataclass, field

from riemhuman.checks import refuse_type
from riemhuman.registration.settings.arms import ArmSettings
from riemhuman.registration.settings.dense_fit import DenseFitSettings
from riemhuman.registration.settings.elastic import ElasticSettings
from riemhuman.registration.settings.matching import AssignmentSettings, MatchingSettings
from riemhuman.registration.settings.preparation import PreparationSettings
from riemhuman.registration.settings.retries import RetrySettings
from riemhuman.registration.settings.rivals import RivalSettings
from riemhuman.registration.settings.search import SearchSettings
from riemhuman.registration.settings.trust import TrustSettings


@dataclass(frozen=True)
class RegistrationSettings:
    """All settings of `ScanRegistration`, by stage, in the order in which the stages run.

    Attributes
    ----------
    preparation : PreparationSettings
        From a scan to evenly spread points with normals, without its surroundings.
    matching : MatchingSettings
        How points of a body find their matches.
    assignment : AssignmentSettings
        Soft assignment.
    search : SearchSettings
        The search over headings, starting poses and up directions.
    dense : DenseFitSettings
        The fit of all parameters to closest points.
    arms : ArmSettings
        Other positions of forearms and hands.
    elastic : ElasticSettings
        The elastic step.
    rivals : RivalSettings
        Which limbs are in doubt.
    trust : TrustSettings
        Which bodies, and which of their vertices, are trusted.
    retries : RetrySettings
        When a scan is searched again.

    Examples
    --------
    >>> from dataclasses import replace
    >>> settings = rh.registration.RegistrationSettings()
    >>> settings.search.n_headings
    6
    >>> finer = replace(settings, search=replace(settings.search, n_headings=8))
    >>> model = rh.datasets.load_open_model("coarse")
    >>> registration = rh.registration.ScanRegistration(model, settings=finer)
    """

    preparation: PreparationSettings = field(default_factory=PreparationSettings)
    matching: MatchingSettings = field(default_factory=MatchingSettings)
    assignment: AssignmentSettings = field(default_factory=AssignmentSettings)
    search: SearchSettings = field(default_factory=SearchSettings)
    dense: DenseFitSettings = field(default_factory=DenseFitSettings)
    arms: ArmSettings = field(default_factory=ArmSettings)
    elastic: ElasticSettings = field(default_factory=ElasticSettings)
    rivals: RivalSettings = field(default_factory=RivalSettings)
    trust: TrustSettings = field(default_factory=TrustSettings)
    retries: RetrySettings = field(default_factory=RetrySettings)

    def __post_init__(self) -> None:
        _check_part(self.preparation, "preparation", PreparationSettings)
        _check_part(self.matching, "matching", MatchingSettings)
        _check_part(self.assignment, "assignment", AssignmentSettings)
        _check_part(self.search, "search", SearchSettings)
        _check_part(self.dense, "dense", DenseFitSettings)
        _check_part(self.arms, "arms", ArmSettings)
        _check_part(self.elastic, "elastic", ElasticSettings)
        _check_part(self.rivals, "rivals", RivalSettings)
        _check_part(self.trust, "trust", TrustSettings)
        _check_part(self.retries, "retries", RetrySettings)


def _check_part(part: object, name: str, expected: type) -> None:
    if not isinstance(part, expected):
        refuse_type(part, name, f"a {expected.__name__}")


DEFAULT_SETTINGS = RegistrationSettings()
