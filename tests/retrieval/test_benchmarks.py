"""The benchmark: records, failures, times, and the tables that say what is better than ours."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from known_surfaces import sphere
from open_bodies import coarse_bodies

from riemhuman.descriptors import HeatKernelSignature, ShapeDNA
from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.retrieval import (
    BenchmarkRecord,
    RetrievalScores,
    benchmark,
    format_benchmark,
    representations,
    scores,
)
from riemhuman.retrieval.benchmarks import GAUGE_INVARIANT, SOBOLEV
from riemhuman.surfaces import Template
from riemhuman.topologies import TopologyMap


class Some(SimpleNamespace):
    """Bodies with a length."""

    def __len__(self):
        return len(self.subject)


def some_of(everyone, chosen, **fields):
    per_body = {name: getattr(everyone, name)[chosen] for name in ("points", "subject", "pose")}
    return Some(template=everyone.template, **per_body, **fields)


@pytest.fixture(scope="module")
def few():
    """Return three people in three poses."""
    chosen = [10 * person + pose for person in (0, 4, 8) for pose in (0, 2, 5)]
    return some_of(coarse_bodies(), chosen)


class Heights:
    """The least a descriptor can be."""

    def describe(self, vertices, faces):
        assert len(faces) == 2400
        return np.ptp(vertices, axis=0)[1:2]

    def distances(self, vectors):
        return np.abs(vectors - vectors.T)


def test_descriptors_share_what_is_costly(few, monkeypatch):
    apart = {"dna": ShapeDNA(10), "heat": HeatKernelSignature(n_eigenvalues=12)}
    alone = [record for name in apart for record in benchmark(few, {name: apart[name]})]
    monkeypatch.setattr(ShapeDNA, "describe", None)
    monkeypatch.setattr(HeatKernelSignature, "describe", None)
    together = benchmark(few, apart)
    assert [record.scores for record in together] == [record.scores for record in alone]
    assert all(record.seconds_per_body > 0 for record in together)


def test_metrics_by_default(few):
    records = benchmark(few)
    names = ["shape metric (1, 0.0001, 0)", "pose metric (0, 0, 1)", "area metric"]
    names += ["person metric", "SRNF", "rotation metric", "general elastic metric (1, 1, 1)"]
    assert [record.representation for record in records] == [name for name in names for _ in "ab"]
    assert [record.task for record in records] == 7 * ["shape", "pose"]
    by_key = {(record.representation, record.task): record for record in records}
    assert by_key[names[0], "shape"].scores.nn == 100.0
    assert by_key[names[1], "pose"].scores.nn == 100.0
    assert by_key[names[2], "shape"].scores.nn == 100.0
    assert all(record.seconds_per_body == 0 < record.seconds_per_pair for record in records)
    assert all(record.problem is None for record in records)


def test_descriptors_by_their_two_methods(few):
    shape, pose = benchmark(few, {"height": Heights()}, progress=False)
    heights = np.ptp(few.points, axis=1)[:, 1:2]
    assert shape.scores == scores(np.abs(heights - heights.T), few.subject)
    assert pose.scores == scores(np.abs(heights - heights.T), few.pose)
    assert 0 < shape.seconds_per_body < 60
    assert 0 < shape.seconds_per_pair < 60


def test_a_refusal_is_told_and_the_others_go_on(few):
    class Refusing(Heights):
        def describe(self, vertices, faces):
            raise ArgumentError("body 3 has no head")

    class Unfinished(Heights):
        def distances(self, vectors):
            return np.full((len(vectors), len(vectors)), np.nan)

    records = benchmark(few, {"a": Refusing(), "b": Unfinished(), "height": Heights()})
    assert [record.scores is None for record in records] == 4 * [True] + 2 * [False]
    assert records[0].problem == records[1].problem == "ArgumentError: body 3 has no head"
    assert "distances[0, 1] is nan" in records[2].problem
    text = format_benchmark(records)
    assert re.search(r"^a +failed: ArgumentError: body 3 has no head$", text, re.MULTILINE)


def test_metrics_do_not_take_meshes_that_are_not_registered(few):
    class Meshes:
        subject = few.subject
        pose = None

        def __len__(self):
            return len(few)

        def __getitem__(self, index):
            return few.points[index], few.template.faces

    records = benchmark(Meshes(), {"height": Heights(), "metric": SimpleNamespace(dist_pairwise=1)})
    assert [record.task for record in records] == ["shape", "shape"]
    assert records[0].scores is not None
    assert "needs surfaces registered to a template" in records[1].problem
    with pytest.raises(ArgumentTypeError, match="must be registered surfaces"):
        benchmark(Meshes())


def test_labels_that_no_two_share_are_refused(few):
    alone = Some(points=few.points[:1], template=few.template, subject=[0], pose=[0])
    with pytest.raises(ArgumentError, match="no two of 1 surfaces do"):
        benchmark(alone, {"height": Heights()})


def record(name, task, values):
    return BenchmarkRecord(name, task, RetrievalScores(*values, 9), 0.0, 1e-5)


def test_table_marks_the_best_of_each_column():
    records = [
        record("shape metric", "shape", [100.0, 99.31, 100.0, 99.0]),
        record("theirs", "shape", [98.0, 99.34, 99.9, 99.5]),
        BenchmarkRecord("other", "shape", RetrievalScores(3.0, 99.62, 0.0, 0.0, 9), 0.25, 1e-3),
        record("theirs", "pose", [90.0, 80.0, 70.0, 60.04]),
    ]
    who, how, _ = format_benchmark(records).split("\n\n")
    lines = [line.split() for line in who.splitlines()]
    titles = "Who is it? NN FT ST mAP ms a body ms a pair"
    assert lines[0] == titles.split()
    assert lines[1] == ["shape", "metric", "100.0*", "99.3", "100.0*", "99.0", "-", "0.0100"]
    assert lines[2] == ["theirs", "98.0", "99.3", "99.9", "99.5*", "-", "0.0100"]
    assert lines[3] == ["other", "3.0", "99.6*", "0.0", "0.0", "250.0", "1.0000"]
    assert how.splitlines()[1].split()[1:5] == ["90.0*", "80.0*", "70.0*", "60.0*"]


TEMPLATE_FREE = ["APT", "ShapeDNA", "HKS", "WKS"]


@pytest.mark.slow
def test_registered_bodies_have_all():
    everyone = coarse_bodies()
    names = list(representations(everyone))
    assert names[:3] == ["shape metric (1, 0.0001, 0)", "pose metric (0, 0, 1)", "area metric"]
    assert set(TEMPLATE_FREE) < set(names)
    assert {SOBOLEV, GAUGE_INVARIANT} < set(names)
    assert "model shape vector" in names
    few = some_of(everyone, [0, 2, 80, 82], model=everyone.model)
    records = benchmark(few, representations(few))
    assert [record.problem for record in records if record.scores is None] == []
    assert len(records) == 2 * len(names)
    who = {record.representation: record.scores.nn for record in records if record.task == "shape"}
    assert all(who[name] == 100.0 for name in TEMPLATE_FREE)


def test_templates_of_mixed_orientation_have_no_gauge_invariant_metric(monkeypatch):
    """Nor a person metric, where the template cannot be registered, which is tried."""

    def refuse(template):
        raise ArgumentError("the registration of template is not trusted")

    monkeypatch.setattr(TopologyMap, "fit", refuse)
    bodies = coarse_bodies()
    faces = bodies.template.faces.copy()
    faces[0] = faces[0, ::-1]
    mixed = SimpleNamespace(points=bodies.points, template=Template(bodies.points[0], faces))
    names = set(representations(mixed))
    assert SOBOLEV in names
    assert not names & {GAUGE_INVARIANT, "person metric"}


def test_without_a_model_or_registration():
    bodies = coarse_bodies()
    without = SimpleNamespace(points=bodies.points, template=bodies.template, model=None)
    assert not any(name.startswith("model") for name in representations(without))
    assert list(representations([sphere(1), sphere(2)])) == TEMPLATE_FREE
    assert np.isfinite(representations([])["ShapeDNA"].describe(*sphere(2))).all()
