"""Whether two bodies can be one person."""

import numpy as np
import pytest
from open_bodies import coarse_bodies

from riemhuman.datasets import load_open_bodies, load_open_model
from riemhuman.errors import ArgumentError
from riemhuman.geometry import AlignedSurfaces, AreaMetric
from riemhuman.measurements import person_distance, usual_distances
from riemhuman.measurements.measurement_set import load_json
from riemhuman.measurements.people import usual_distances_of, usual_metrics
from riemhuman.surfaces import Template


@pytest.fixture(scope="module")
def bodies():
    return load_open_bodies("coarse", people=3)


@pytest.mark.parametrize(("other", "is_doubted"), [(3, False), (8, False), (10, True), (23, True)])
def test_people_who_were_not_used_are_told_apart(bodies, other, is_doubted):
    """Bodies 0 to 9 are one person, in poses like those of each other person."""
    people = person_distance(bodies[0], bodies[other], bodies.template.faces)
    assert people.is_hardly_one_person == is_doubted
    space_of_body = AlignedSurfaces(
        Template(bodies[0], bodies.template.faces), equip=False, scale=None
    )
    assert people.distance == pytest.approx(
        float(AreaMetric(space_of_body).dist(bodies[0], bodies[other]))
    )
    assert people.text.startswith("probably not the same person: their shape distance is ")


def test_stored_distances_are_those_of_the_bodies():
    template = load_open_model("coarse").template
    metrics = usual_metrics(template)
    assert set(load_json("usual_distances.json")) == set(metrics)
    for name in ("shape", "areas"):
        stored = usual_distances(lambda template, name=name: usual_metrics(template)[name])
        computed = usual_distances_of(metrics[name])
        assert stored.one_person == pytest.approx(computed.one_person, abs=1e-6)
        assert stored.two_people == pytest.approx(computed.two_people, abs=1e-6)
    other = usual_distances(lambda template: AreaMetric(AlignedSurfaces(template), 0.3))
    assert other != usual_distances(lambda template: AreaMetric(AlignedSurfaces(template)))


def test_usual_distances_leave_out_bodies_of_one_person_in_one_pose():
    bodies = coarse_bodies()
    distances = np.random.default_rng(0).uniform(size=(len(bodies), len(bodies)))

    class Metric:
        def dist_pairwise(self, points):
            return distances

    usual = usual_distances(lambda template: Metric())
    pairs = [(i, j) for i in range(len(bodies)) for j in range(len(bodies)) if i != j]
    one_person = [distances[i, j] for i, j in pairs if bodies.subject[i] == bodies.subject[j]]
    one_pose = [distances[i, j] for i, j in pairs if bodies.pose[i] == bodies.pose[j]]
    assert usual.one_person == np.median(one_person)
    assert usual.two_people == np.median(one_pose)


def test_bodies_must_share_triangles(bodies):
    with pytest.raises(ArgumentError, match="after must have shape"):
        person_distance(bodies[0], bodies[1][:-1], bodies.template.faces)
