"""Features of fields that belong to no surface."""

from types import SimpleNamespace

import numpy as np

from riemhuman.terms._sum import SumOfTerms


def field_features(term, fields, areas, precision):
    """Return the features of fields of one term over triangles with areas, and their rounding."""
    faces = np.zeros((len(areas), 3), dtype=int)
    template = SimpleNamespace(faces=faces, frame_coefficients=None, face_areas=areas)
    return SumOfTerms([term], template, lambda _: fields).features(fields[0], precision)
