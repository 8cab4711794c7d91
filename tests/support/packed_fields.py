"""Features of fields that belong to no surface."""

from riemhuman.terms._drivers import BulkOfFields


def field_features(term, fields, areas, precision):
    """Return the features of fields of one term over triangles with areas, and their rounding."""
    return BulkOfFields(term, areas, lambda _: fields).features(fields[0], precision)
