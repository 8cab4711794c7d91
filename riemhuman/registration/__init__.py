"""Registration of raw scans by a body model, without landmarks, or by a template."""

from __future__ import annotations

from typing import TYPE_CHECKING

from riemhuman.provided import topologies
from riemhuman.registration.correspondences import (
    ScanCorrespondence,
    correspondence,
    geodesic_errors,
)
from riemhuman.registration.folders import (
    FolderResult,
    ScanRecord,
    read_records,
    register_folder,
)
from riemhuman.registration.registered_scans import RegisteredScan, RegistrationTrace
from riemhuman.registration.registration_settings import RegistrationSettings
from riemhuman.registration.scan_registration import ScanRegistration
from riemhuman.registration.scans import Scan, load_landmarks, load_scan
from riemhuman.registration.scans_over_bodies import ScanOverBody, lay_over_body
from riemhuman.registration.simulated_scans import SimulatedScan, simulated_scan
from riemhuman.registration.template_registration import TemplateRegistration

__all__ = [
    "FolderResult",
    "RegisteredScan",
    "RegistrationSettings",
    "RegistrationTrace",
    "Scan",
    "ScanCorrespondence",
    "ScanOverBody",
    "ScanRecord",
    "ScanRegistration",
    "SimulatedScan",
    "TemplateRegistration",
    "correspondence",
    "geodesic_errors",
    "lay_over_body",
    "load_landmarks",
    "load_scan",
    "read_records",
    "register_folder",
    "simulated_scan",
]


def __dir__() -> list[str]:
    return sorted(__all__)


if not TYPE_CHECKING:  # otherwise, type checkers would accept any name

    def __getattr__(name: str) -> object:
        # Scripts know these names here; `riemhuman.topologies`, which uses this subpackage, has
        # them.
        if name in ("TopologyMap", "transfer_model"):
            return getattr(topologies(), name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
