"""Every representation, on the data it applies to."""

from types import SimpleNamespace

import numpy as np
from descriptor_meshes import sphere

from riemhuman.datasets import load_open_bodies
from riemhuman.report import benchmark
from riemhuman.report._representations import GAUGE_INVARIANT, SOBOLEV, available
from riemhuman.surfaces import Template

TEMPLATE_FREE = ["APT", "ShapeDNA", "HKS", "WKS"]


class Some(SimpleNamespace):
    def __len__(self):
        return len(self.subject)


def test_registered_bodies_have_all():
    everyone = load_open_bodies("coarse")
    names = list(available(everyone))
    assert names[:3] == ["shape metric (1, 0.0001, 0)", "pose metric (0, 0, 1)", "SRNF"]
    assert set(TEMPLATE_FREE) < set(names)
    assert {SOBOLEV, GAUGE_INVARIANT} < set(names)
    if hasattr(everyone.model, "fit"):
        assert "model shape vector" in names

    chosen = [0, 2, 80, 82]
    few = Some(
        points=everyone.points[chosen],
        template=everyone.template,
        model=everyone.model,
        subject=everyone.subject[chosen],
        pose=everyone.pose[chosen],
    )
    records = benchmark(few, available(few))
    assert [record.problem for record in records if record.scores is None] == []
    assert len(records) == 2 * len(names)
    who = {record.representation: record.scores.nn for record in records if record.task == "shape"}
    assert all(who[name] == 100.0 for name in TEMPLATE_FREE)


def test_templates_of_mixed_orientation_have_no_gauge_invariant_metric():
    bodies = load_open_bodies("coarse")
    faces = bodies.template.faces.copy()
    faces[0] = faces[0, ::-1]
    mixed = SimpleNamespace(points=bodies.points, template=Template(bodies.points[0], faces))
    names = set(available(mixed))
    assert SOBOLEV in names
    assert GAUGE_INVARIANT not in names


def test_without_a_model_or_registration():
    bodies = load_open_bodies("coarse")
    without = SimpleNamespace(points=bodies.points, template=bodies.template, model=None)
    assert not any(name.startswith("model") for name in available(without))
    assert list(available([sphere(1), sphere(2)])) == TEMPLATE_FREE
    assert np.isfinite(available([])["ShapeDNA"].describe(*sphere(2))).all()
