"""Features of fields that belong to no surface."""

from types import SimpleNamespace

from riemhuman.terms._drivers import SumOfTerms


def field_features(term, fields, areas, precision):
    """Return the features of fields of one term over triangles with areas, and their rounding."""
    template = SimpleNamespace(faces=None, frame_coefficients=None, face_areas=areas)
    return SumOfTerms([term], template, lambda _: fields).features(fields[0], precision)
