"""The retrieval tables of the paper, on the registrations of FAUST, for comparison."""

from __future__ import annotations

PAPER_TABLES: dict[str, tuple[tuple[str, float, float, float], ...]] = {
    "shape": (
        ("GDVAE intrinsic", 27.0, 24.8, 46.2),
        ("Zhou et al., shape", 42.0, 24.8, 42.8),
        ("SMPL shape vector", 98.0, 72.4, 86.7),
        ("APT", 96.0, 86.5, 96.2),
        ("metric (1, 0.0001, 0)", 100.0, 94.8, 97.1),
    ),
    "pose": (
        ("GDVAE extrinsic", 60.0, 38.0, 54.2),
        ("Zhou et al., pose", 82.0, 69.2, 83.4),
        ("SMPL pose vector", 80.0, 84.4, 95.2),
        ("SRNF", 73.0, 77.7, 94.4),
        ("metric (0, 0, 1)", 85.0, 88.3, 97.6),
    ),
}
"""Tables 1 and 2 of the paper: representation, nearest neighbour, first and second tier."""
