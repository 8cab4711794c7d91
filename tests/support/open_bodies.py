"""The open bodies of few vertices, which a process loads once."""

from functools import cache

from riemhuman.datasets import Bodies, load_open_bodies


@cache
def coarse_bodies() -> Bodies:
    """Return the hundred plain bodies; tests change none of their arrays."""
    return load_open_bodies("coarse")
