"""The settings of registration, a file a stage; the defaults were calibrated on simulated scans.

`tests/benchmarks/test_registration.py` prints what they do. Each class names the fields that it
checks, as in `check_amounts(area=self.area)`. That repeats names, but an editor and mypy follow
them, and nothing about a field is said elsewhere than in its class.
"""

from riemhuman.registration.settings.arms import ArmSettings
from riemhuman.registration.settings.dense_fit import DenseFitSettings
from riemhuman.registration.settings.elastic import ElasticSettings
from riemhuman.registration.settings.matching import AssignmentSettings, MatchingSettings
from riemhuman.registration.settings.preparation import PreparationSettings
from riemhuman.registration.settings.registration import DEFAULT_SETTINGS, RegistrationSettings
from riemhuman.registration.settings.retries import RetrySettings
from riemhuman.registration.settings.rivals import RivalSettings
from riemhuman.registration.settings.search import SearchRound, SearchSettings
from riemhuman.registration.settings.trust import TrustSettings

__all__ = [
    "DEFAULT_SETTINGS",
    "ArmSettings",
    "AssignmentSettings",
    "DenseFitSettings",
    "ElasticSettings",
    "MatchingSettings",
    "PreparationSettings",
    "RegistrationSettings",
    "RetrySettings",
    "RivalSettings",
    "SearchRound",
    "SearchSettings",
    "TrustSettings",
]
