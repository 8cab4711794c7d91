"""Registration of raw scans by a body model, without landmarks, or by a template."""

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
from riemhuman.registration.scan_registration import (
    RegisteredScan,
    ScanRegistration,
    TemplateRegistration,
    transfer_model,
)
from riemhuman.registration.scans import Scan, find_inward_triangles, load_landmarks, load_scan
from riemhuman.registration.simulated_scans import SimulatedScan, simulated_scan
from riemhuman.registration.topology_map import TopologyMap

__all__ = [
    "FolderResult",
    "RegisteredScan",
    "Scan",
    "ScanCorrespondence",
    "ScanRecord",
    "ScanRegistration",
    "SimulatedScan",
    "TemplateRegistration",
    "TopologyMap",
    "correspondence",
    "find_inward_triangles",
    "geodesic_errors",
    "load_landmarks",
    "load_scan",
    "read_records",
    "register_folder",
    "simulated_scan",
    "transfer_model",
]


def __dir__() -> list[str]:
    return sorted(__all__)
