"""Contracts of data sets and descriptors."""

from riemhuman.protocols.data import Dataset, Descriptor

__all__ = ["Dataset", "Descriptor"]
