"""Traces keep what each stage of a registration found."""

import numpy as np


def test_a_trace_keeps_every_stage(registration, scan, result):
    found = registration.solve(scan.surface, trace=True)
    assert result.trace is None
    np.testing.assert_array_equal(found.points, result.points)
    trace = found.trace
    surfaces = trace.surfaces()
    assert list(surfaces) == ["start", "search", "dense fit", "arms and hands", "elastic step"]
    np.testing.assert_array_equal(surfaces["elastic step"], found.points)
    off = [np.linalg.norm(points - scan.body, axis=1).mean() for points in surfaces.values()]
    assert off[0] > 3.0 * off[1]  # the search brings the start to the scan
    assert max(off[2:]) < off[1]  # and the later stages bring it closer
    counts = [len(trace.search.starts), *map(len, trace.search.rounds)]
    assert counts == sorted(counts, reverse=True)
    assert trace.search.candidates[0].likelihood == max(
        candidate.likelihood for candidate in trace.search.candidates
    )
    assert trace.verdict.trusted == found.trusted
    assert list(trace.seconds) == ["search", "dense fit", "arms and hands", "elastic step", "trust"]
    assert min(trace.seconds.values()) > 0.0
