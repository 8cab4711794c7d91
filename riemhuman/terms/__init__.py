"""Terms of surface metrics, and the loops that run weighted sums of them."""

from riemhuman.kernels.compilation import compiled
from riemhuman.kernels.surface import Derivatives
from riemhuman.terms.cone import ConeTerm, EbinTerm
from riemhuman.terms.flat import FlatTerm, RootNormalTerm
from riemhuman.terms.normals import NormalTerm, RotationTerm
from riemhuman.terms.term import FieldSpaces, Term

__all__ = [
    "ConeTerm",
    "Derivatives",
    "EbinTerm",
    "FieldSpaces",
    "FlatTerm",
    "NormalTerm",
    "RootNormalTerm",
    "RotationTerm",
    "Term",
    "compiled",
]
