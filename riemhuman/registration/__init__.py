"""From a raw scan to a registered body, without landmarks."""

from riemhuman.registration.simulated_scans import SimulatedScan, simulated_scan

__all__ = ["SimulatedScan", "simulated_scan"]


def __dir__() -> list[str]:
    return sorted(__all__)
