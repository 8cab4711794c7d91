"""Who is it, with noise on the vertices, and of people who were scanned?

    pytest tests/benchmarks/test_identity.py --benchmark-enable -s

prints, for the natural open bodies of people by whom nothing was chosen, at full resolution,
retrieval by every metric with independent noise on the vertices; by `AreaMetric` for several times
of its heat flow; by `AreaMetric` and `PersonMetric` if the bodies have other triangles; and how
much of the area the paper's metric counts as changed. Then ten people are scanned twice in two
poses with 2 mm of noise, the scans are registered, and it prints of how many the other scan is the
nearest; this takes minutes (`-k "not scans"` leaves it out). The scans are of natural bodies, and
of bodies that the model cannot make. Last, without scans, it prints retrieval among people whom
the model cannot make and whose flesh moves with the pose.

With RIEMHUMAN_FAUST=FOLDER in the environment the bodies are those of MPI FAUST instead.
"""

import os

import numpy as np
import pytest
from people_whose_flesh_moves import people_whose_flesh_moves
from performances import clocked
from scanned_people import foreign_bodies, points_at

import riemhuman as rh
from riemhuman.registration import ScanRegistration, simulated_scan
from riemhuman.registration.simulated_scans import remesh

FAUST = os.environ.get("RIEMHUMAN_FAUST")
SEED, FOREIGN_SEED, NOISE_SEED = 31, 5, 7
MILLIMETRES = (0.0, 0.2, 0.5, 1.0, 2.0, 4.0)
TIMES = (0.01, 0.02, 0.05, 0.1, 0.3)
# Two poses of every person, by their place in the order of the bodies.
POSES = (1, 6)


@pytest.fixture(scope="module")
def bodies():
    if FAUST:
        return rh.datasets.load_faust(FAUST)
    return rh.datasets.load_open_bodies("full", "natural", SEED)


def metrics_over(template):
    space = rh.AlignedSurfaces(template, equip=False)
    return {
        "paper's, (1, 0.0001, 0)": rh.ElasticMetric(space, 1.0, 1e-4, 0.0),
        "(1, 1, 0)": rh.ElasticMetric(space, 1.0, 1.0, 0.0),
        "SRNF": rh.SRNFMetric(space),
        "AreaMetric": rh.AreaMetric(space),
        "PersonMetric": person_metric(space),
    }


def person_metric(space):
    """Return the metric of people, also of FAUST's, whose triangles are not the open model's."""
    topology = rh.topologies.TopologyMap.fit(space.template) if FAUST else None
    return rh.PersonMetric(space, topology)


def area_metrics(template):
    space = rh.AlignedSurfaces(template, equip=False)
    return {f"AreaMetric, {time:g} m²": rh.AreaMetric(space, time) for time in TIMES}


def noisy(bodies, millimetres):
    noise = np.random.default_rng(NOISE_SEED).standard_normal(bodies.points.shape)
    return bodies.points + 0.001 * millimetres * noise


def shown(scores):
    return f"{scores.nn:.0f} / {scores.first_tier:.1f} / {scores.second_tier:.1f}"


def test_noise_on_vertices(benchmark, bodies):
    metrics = metrics_over(bodies.template) | area_metrics(bodies.template)
    found = {name: [] for name in metrics}

    def run():
        for millimetres in MILLIMETRES:
            points = noisy(bodies, millimetres)
            for name, metric in metrics.items():
                distances = metric.dist_pairwise(points, n_jobs=-1)
                found[name].append(rh.retrieval.scores(distances, bodies.subject))

    clocked(run, benchmark=benchmark)
    print(
        f"\n| NN / FT / ST, noise of | {' mm | '.join(f'{noise:g}' for noise in MILLIMETRES)} mm |"
    )
    for name, row in found.items():
        print(f"| {name} | {' | '.join(map(shown, row))} |")
    assert all(scores.nn >= 99.0 for scores in found["AreaMetric"])


def test_other_triangles(benchmark, bodies):
    """The same bodies remeshed: is the person known by a map that one of them gives?"""
    if FAUST:
        pytest.skip("FAUST has other triangles as it is")
    template = bodies.template
    rng = np.random.default_rng(NOISE_SEED)
    vertices, faces = remesh(template.vertices, template.faces, 6890, rng)
    places, _ = rh.surfaces.nearest_points(vertices, template.vertices, template.faces)
    others = np.stack([points_at(places, points, template.faces) for points in bodies.points])
    space = rh.AlignedSurfaces(rh.Template(others[0], faces), equip=False)
    topology, seconds, _ = clocked(
        lambda: rh.topologies.TopologyMap.fit(space.template), benchmark=benchmark
    )
    metrics = {"AreaMetric": rh.AreaMetric(space), "PersonMetric": rh.PersonMetric(space, topology)}
    print(f"\n{others.shape[1]} other vertices, the map took {seconds:.0f} s; 0 | 2 | 4 mm")
    for name, metric in metrics.items():
        scores = [
            rh.retrieval.scores(
                metric.dist_pairwise(
                    others + 0.001 * millimetres * rng.standard_normal(others.shape)
                ),
                bodies.subject,
            )
            for millimetres in (0.0, 2.0, 4.0)
        ]
        print(f"| {name} | {' | '.join(map(shown, scores))} |")
        assert min(score.nn for score in scores) >= 99.0


def share_at_the_end(g, others, lam, shares):
    """Return on which share of the area θ reaches π, from one metric field to others."""
    # With δ the logarithm of the ratio of the eigenvalues of g₁⁻¹g₂, whose trace and determinant
    # give cosh(½δ), the traceless part L₀ of log(g₁⁻¹g₂) has tr(L₀²) = ½δ², and
    # θ = √(tr(L₀²)/λ)/4 (equation 5 of the paper).
    products = g[:, 1, 1] * others[:, :, 0, 0] + g[:, 0, 0] * others[:, :, 1, 1]
    products -= 2.0 * g[:, 0, 1] * others[:, :, 0, 1]
    roots = np.sqrt(determinants(g) * determinants(others))
    end = np.cosh(2.0 * np.pi * np.sqrt(2.0 * lam))
    return (0.5 * products >= end * roots) @ shares


def determinants(g):
    return g[..., 0, 0] * g[..., 1, 1] - g[..., 0, 1] ** 2


@pytest.mark.parametrize("lam", [1e-4, 1.0])
def test_where_the_angle_reaches_its_end(benchmark, bodies, lam):
    space = rh.AlignedSurfaces(bodies.template, equip=False)
    shares = bodies.template.face_areas / bodies.template.face_areas.sum()
    same = np.equal.outer(bodies.subject, bodies.subject)
    changed = np.zeros(same.shape)

    def run():
        for millimetres in (0.0, 1.0):
            fields = space.metric_field(noisy(bodies, millimetres))
            for i, field in enumerate(fields):
                changed[i] = share_at_the_end(field, fields, lam, shares)
            within = changed[same & ~np.eye(len(same), dtype=bool)].mean()
            counted = rh.retrieval.scores(0.5 * (changed + changed.T), bodies.subject)
            print(
                f"\nλ = {lam:g}, noise of {millimetres:g} mm: θ reaches π on "
                f"{100 * changed[~same].mean():.0f} % of the area between people, "
                f"{100 * within:.0f} % within a person; this share alone as the distance: "
                f"{shown(counted)}"
            )

    clocked(run, benchmark=benchmark)


def scans_of_people(bodies):
    """Yield the person, the pose and a scan of every person in two poses."""
    poses = list(dict.fromkeys(bodies.pose))
    chosen = [poses[number] for number in POSES]
    for number in range(len(bodies)):
        if bodies.pose[number] in chosen:
            rng = np.random.default_rng([SEED, number])
            surface, faces = bodies.points[number], bodies.template.faces
            yield bodies.subject[number], scanned(surface, faces, rng)


def scans_of_foreign_people(model):
    surfaces, faces, _ = foreign_bodies(model, FOREIGN_SEED, 10, len(POSES))
    for person, pair in enumerate(surfaces):
        for moment, surface in enumerate(pair):
            rng = np.random.default_rng([FOREIGN_SEED, person, moment])
            yield person, scanned(surface, faces, rng)


def scanned(surface, faces, rng):
    return simulated_scan(surface, faces, rng, n_points=12_000, mesh=True, noise=0.002).surface


@pytest.mark.parametrize("people", ["natural bodies", "bodies the model cannot make"])
def test_scans_through_registration(benchmark, bodies, people):
    if FAUST and people != "natural bodies":
        pytest.skip("of FAUST there is one set of people")
    model = rh.datasets.load_open_model("coarse")
    registration = ScanRegistration(model)
    natural = people == "natural bodies"
    scans = scans_of_people(bodies) if natural else scans_of_foreign_people(model)
    subjects, surfaces = zip(*scans, strict=True)
    results, seconds, _ = clocked(
        lambda: [registration.solve(surface) for surface in surfaces], benchmark=benchmark
    )
    points = np.stack([result.points for result in results])
    n_refused = sum(not result.trusted for result in results)
    name = "MPI FAUST" if FAUST else people
    print(f"\n{len(points)} scans of {name}, {seconds / len(points):.1f} s each", end="")
    print(f", {n_refused} refused: the other scan of the person is the nearest for")
    for metric_name, metric in (
        metrics_over(model.template) | area_metrics(model.template)
    ).items():
        scores = rh.retrieval.scores(metric.dist_pairwise(points, precision="double"), subjects)
        print(f"| {metric_name} | {round(scores.nn * len(points) / 100)} of {len(points)} |")
    assert scores.n_queries == len(points)


# Seed and strength; by the first two, the number of directions and their weights were chosen.
@pytest.mark.parametrize(("seed", "strength"), [(3, 1.0), (3, 2.0), (4, 1.5), (5, 1.5)])
def test_people_whose_flesh_moves(benchmark, seed, strength):
    people = people_whose_flesh_moves(seed, 10, strength)
    metrics = metrics_over(rh.datasets.load_open_model("coarse").template)
    found = {}

    def run():
        for name, metric in metrics.items():
            distances = metric.dist_pairwise(people.points)
            found[name] = rh.retrieval.scores(distances, people.subject)

    clocked(run, benchmark=benchmark)
    print(f"\nflesh that moves, seed {seed}, strength {strength:g}")
    for name, scores in found.items():
        print(f"| {name} | {shown(scores)} |")
    assert found["PersonMetric"].first_tier > found["AreaMetric"].first_tier
