"""Metrics on legal surfaces that rounding does not like: slivers, far, flat, folded, coincident.

Every property of `adversarial_properties` for every metric of `adversarial_metrics` it holds for,
each on its own surfaces; `pytest -s` prints the accuracy by condition.
"""

import itertools
import sys
from collections import Counter
from zlib import crc32

import numpy as np
import pytest
from autograd import grad
from lengths import sample, some
from trust.adversarial_metrics import subject_of
from trust.adversarial_properties import CELLS, PROPERTIES, ROUNDING
from trust.adversarial_surfaces import FAMILIES, MESHES, make, surfaces, weights

import riemhuman as rh

# Derivatives are taken by the chain rule from edges: what overflows or divides by 0 is an error.
pytestmark = pytest.mark.filterwarnings("error")


@pytest.mark.parametrize(("name", "metric"), CELLS, ids=map(" of ".join, CELLS))
def test_property(name, metric):
    wanted = PROPERTIES[name]
    rng = np.random.default_rng(crc32(f"{name} of {metric}".encode()))
    for _ in range(some(25, 4)):
        found, abc = surfaces(rng), weights(rng)
        wanted.check(subject_of(metric, found, abc, wanted.smooth), rng)


def test_accuracy_by_condition():
    """Print the largest relative errors."""
    columns = {
        "shape": ("shape", 1e-4),
        "stretch": ("shape", 1.0),
        "pose": ("pose", 1.0),
        "SRNF": ("SRNF", 1.0),
    }
    rows = {}
    kinds = itertools.product(enumerate(FAMILIES), (0.0, 0.5, 1.0), MESHES)
    for (number, family), severity, mesh in sample(kinds, 5, 2):  # of every decade of the condition
        found = make(family, mesh, severity, number)
        if not found.legal:
            continue
        decade = 2 * int(np.log10(found.condition) / 2)
        row = rows.setdefault(decade, Counter())
        row["surfaces"] += 1
        for column, (name, lam) in columns.items():
            subject = subject_of(name, found, (1.0, lam, 1.0))
            exact = float(subject.exact(0, 1) ** 0.5)
            error = abs(subject.metric.dist(*subject.points[:2]) - exact)
            assert error <= ROUNDING * subject.rounding + 1e-13 * exact
            row[column] = max(row[column], error / subject.scale)
            row["of εκ"] = max(row["of εκ"], error / subject.rounding)
    names = [*columns, "of εκ"]
    lines = ["", "condition     surfaces" + "".join(f"{name:>9}" for name in names)]
    for decade, row in sorted(rows.items()):
        text = "".join(f"{row[name]:9.0e}" for name in names)
        lines.append(f"{f'1e{decade} to 1e{decade + 2}':14}{row['surfaces']:8}{text}")
    assert len(rows) > 3
    sys.stdout.write("\n".join(lines) + "\n")


@pytest.mark.parametrize("power", [1, 4, 7, 8, 9, 12])
def test_energies_of_nearly_antipodal_normals_keep_their_digits(power):
    """The compiled energy took the angle from a chord of nearly 2, and lost half of its digits."""
    template = rh.Template([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    metric = rh.ElasticMetric(rh.AlignedSurfaces(template, equip=False), 0.0, 0.0, 1.0)
    angle = np.pi - 10.0**-power
    turn = [[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]]
    path = np.stack([template.vertices, template.vertices @ np.transpose(turn)])
    energy, gradient = metric.energy_and_gradient(path)
    np.testing.assert_allclose(energy, 0.5 * angle**2, rtol=1e-14)
    np.testing.assert_allclose(metric.energy(path), 0.5 * angle**2, rtol=1e-14)
    expected = [grad(metric.squared_dist, k)(*path) for k in (0, 1)]
    np.testing.assert_allclose(gradient, expected, rtol=1e-13, atol=1e-14)
