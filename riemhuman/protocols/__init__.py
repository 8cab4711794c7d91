"""What the parts of the library ask of data sets and descriptors; interruption of solvers."""

from riemhuman.protocols.data import Dataset, Descriptor
from riemhuman.protocols.interruption import INTERRUPTED, uninterrupted, was_interrupted

__all__ = ["INTERRUPTED", "Dataset", "Descriptor", "uninterrupted", "was_interrupted"]
