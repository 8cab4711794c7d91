"""Distances of many pairs against the NumPy definitions, on the open bodies.

    pytest tests/benchmarks/test_distances.py --benchmark-enable -s

prints, for the metrics of pose, shape, both and SRNF, microseconds a pair of the compiled loops on
one thread and on two, of the definitions on fields computed before and on raw vertices, and their
ratios; how long one thread and two keep processors busy; then all 4,950 pairs from raw vertices,
and smoothed areas beside SRNF. Times are the shortest of several runs, in turns.
"""

import numpy as np
import pytest
from performances import bodies, clocked, shortest

from riemhuman.geometry import AlignedSurfaces, AreaMetric, ElasticMetric, SRNFMetric
from riemhuman.kernels.surface import derivatives

WEIGHTS = {
    "pose": (0.0, 0.0, 1.0),
    "shape": (1.0, 1e-4, 0.0),
    "stretch": (1.0, 1.0, 0.0),
    "mixed": (1.0, 0.1, 0.1),
}
each_metric = pytest.mark.parametrize("name", [*WEIGHTS, "srnf"])


def metric_of(name, resolution):
    space = AlignedSurfaces(bodies(resolution).template, equip=False)
    return SRNFMetric(space) if name == "srnf" else ElasticMetric(space, *WEIGHTS[name])


def definition_on_fields(metric, points):
    """Return the NumPy definition of one distance, all that depends on one surface done before."""
    areas = metric.space.template.face_areas
    fields = [
        [term.fields(derivatives(f, metric.space.template.differential_operator)) for f in points]
        for term in metric.terms
    ]

    def squared_dist():
        return sum(
            term.weight * np.sum(term.squared_dist(one, other) * areas)
            for term, (one, other) in zip(metric.terms, fields, strict=True)
        )

    return squared_dist


@each_metric
def test_against_the_definition(benchmark, name):
    points, metric = bodies("full").points, metric_of(name, "full")
    n_pairs = 4950
    all_features = metric.features(points, "single")
    # Few enough pairs that a run takes milliseconds, as one of the definition does.
    features = tuple(feature[:24] for feature in all_features)
    n_timed = len(features[0]) * (len(features[0]) - 1) // 2
    metric.dist_pairwise(points)  # compiles and loads
    on_fields = definition_on_fields(metric, points[:2])
    assert np.sqrt(on_fields()) == pytest.approx(metric.dist(points[0], points[1]), rel=1e-12)

    times = shortest(
        lambda: metric.bulk.squared_distances(features, features),
        lambda: metric.bulk.squared_distances(all_features, all_features),
        lambda: metric.bulk.squared_distances(all_features, all_features, n_threads=2),
        on_fields,
        lambda: metric.dist(points[0], points[1]),
        lambda: metric.dist_pairwise(points),
        lambda: metric.dist_pairwise(points, n_jobs=2),
        rounds=15,
    )
    one, alone, two = 1e6 * times[:3] / [n_timed, n_pairs, n_pairs]
    fields, vertices = 1e6 * times[3:5]
    print(
        f"\n{name:7}: {one:.2f} us a pair, {two:.2f} with two threads "
        f"({alone / two:.2f} times as fast); definition {fields:.0f} us on fields, {vertices:.0f} "
        f"us on vertices: ratios {fields / one:.0f} and {vertices / one:.0f}, with two threads "
        f"{fields / two:.0f} and {vertices / two:.0f}; {n_pairs:,} pairs from raw vertices "
        f"{times[5]:.3f} s, with two threads {times[6]:.3f} s"
    )
    busy = [
        clocked(
            lambda n=n: metric.bulk.squared_distances(all_features, all_features, n_threads=n), 10
        )[2]
        for n in (1, 2)
    ]
    print(
        f"{name:7}: two threads keep processors busy for {1e3 * busy[1]:.0f} ms, one for "
        f"{1e3 * busy[0]:.0f}: {busy[1] / busy[0]:.2f} times as long"
    )
    benchmark.pedantic(lambda: metric.dist_pairwise(points, n_jobs=2), rounds=3)
    assert busy[1] <= 1.3 * busy[0]
    assert name not in ("pose", "shape") or fields >= 40 * one
    assert times[6] <= 0.5


def test_areas_beside_srnf(benchmark):
    points, space = bodies("full").points, AlignedSurfaces(bodies("full").template, equip=False)
    metrics = {"areas": AreaMetric(space), "srnf": SRNFMetric(space)}
    features = {name: metric.features(points, "single") for name, metric in metrics.items()}
    calls = []
    for name, metric in metrics.items():
        metric.dist_pairwise(points)  # compiles and factorises
        known = features[name]
        calls.append(lambda metric=metric, known=known: metric.bulk.squared_distances(known, known))
        calls.append(lambda metric=metric: metric.features(points, "single"))
    times = shortest(*calls).reshape(2, 2) / [4950, len(points)]
    for name, (pair, body) in zip(metrics, times, strict=True):
        print(f"\n{name:7}: {1e6 * pair:.2f} us a pair, {1e3 * body:.1f} ms a body")
    benchmark.pedantic(calls[0], rounds=3)
    assert times[0, 0] < times[1, 0]
