"""How exactly bodies are found beneath clothes, with and without `clothed=True`.

    pytest tests/benchmarks/test_clothes.py --benchmark-enable -s

prints, for people in simulated garments (see `clothed_people`), the errors of all vertices, of the
surface and of what is trusted, and those of girths; what `clothed=True` costs where there are no
clothes; and how often bodies that are forced into a wrong pose are trusted. The people are of the
body model, natural ones, and others that the model cannot make. None of them were used to choose
the constants.
"""

from functools import partial

import numpy as np
import pytest
from clothed_people import OUTFITS, clothed_scan
from people_whose_flesh_moves import people_whose_flesh_moves
from performances import clocked
from scanned_people import bodies_to_scan, results_to_trust_or_not

import riemhuman as rh
from riemhuman.registration import ScanRegistration, simulated_scan

SEED = 905
# Poses of natural bodies in which clothes hang: no squats, and no hands on the head.
POSES = (0, 1, 2, 3, 4, 7, 8)
GIRTHS = ("chest girth", "waist girth", "hip girth", "mid-thigh girth")
FAR, WRONG_METRES = 0.05, 0.05


@pytest.fixture(scope="module")
def registrations():
    model = rh.datasets.load_open_model("coarse")
    return [ScanRegistration(model, up="y", clothed=clothed) for clothed in (False, True)]


def people(model):
    """Yield ten people of each kind in poses in which clothes hang."""
    rng = np.random.default_rng(SEED)
    natural = rh.datasets.load_open_bodies("coarse", variant="natural", people=SEED)
    moving = people_whose_flesh_moves(SEED, 10, 0.5).points
    performed = [body for *_, body in bodies_to_scan(model, SEED)]
    for number in range(10):
        pose = 10 * number + rng.choice(POSES)
        yield "of the model", performed[pose]
        yield "natural", natural[pose]
        yield "beyond the model", moving[pose]


@pytest.fixture(scope="module")
def dressed(registrations):
    """Return kinds, names of outfits and scans of thirty people, six in each outfit."""
    model, names = registrations[0].model, [*OUTFITS]
    dressed = []
    for number, (kind, body) in enumerate(people(model)):
        outfit = names[number % len(names)]
        rng = np.random.default_rng([SEED, number])
        dressed.append((kind, outfit, clothed_scan(model, body, OUTFITS[outfit], rng)))
    return dressed


def test_errors_beneath_clothes(benchmark, registrations, dressed):
    model = registrations[0].model
    areas = model.template.vertex_areas / model.template.vertex_areas.sum()
    measurements = rh.measurements.Measurements(model)
    rows = []
    for kind, outfit, scan in dressed:
        true_girths = girths_of(measurements, scan.body)
        for registration in registrations:
            solve = partial(registration.solve, scan.points)
            result, seconds, _ = clocked(solve, benchmark=benchmark)
            errors = 1000.0 * np.linalg.norm(result.points - scan.body, axis=1)
            shown = areas * result.trusted_vertices
            share = shown.sum() if result.trusted_vertices.any() else np.nan
            far = shown @ (errors > 1000.0 * FAR) / share
            values = [errors.mean(), errors @ areas, result.trusted, share]
            values += [shown @ errors / share, far]
            values += [*(1000.0 * (girths_of(measurements, result.points) - true_girths)), seconds]
            rows.append((kind, outfit, registration.clothed, values))
    print(
        "\n| | clothed | mean, mm | over the surface | trusted | of the surface | error there |",
        end="",
    )
    print(f" > 5 cm | {' | '.join(f'{name}, bias (sd)' for name in GIRTHS)} | s |")
    groups = [*OUTFITS, *dict.fromkeys(kind for kind, *_ in rows)]
    for group in groups:
        for clothed in (False, True):
            some = [row[3] for row in rows if group in row[:2] and row[2] == clothed]
            # Nothing is averaged of what is not there, as on bodies that are refused.
            some = np.ma.masked_invalid(some)
            means, spreads = some.mean(axis=0).filled(np.nan), some.std(axis=0).filled(np.nan)
            girths = zip(means[6:10], spreads[6:10], strict=True)
            print(
                f"| {group} | {clothed} | {means[0]:.1f} | {means[1]:.1f} | {means[2]:.2f} | "
                f"{means[3]:.2f} | {means[4]:.1f} | {100 * means[5]:.1f} % | "
                f"{' | '.join(f'{mean:.0f} ({spread:.0f})' for mean, spread in girths)} | "
                f"{means[10]:.1f} |"
            )
    beneath = np.array([values for *_, clothed, values in rows if clothed])
    as_skin = np.array([values for *_, clothed, values in rows if not clothed])
    assert beneath[:, 0].mean() < 12.0
    assert beneath[:, 1].mean() < as_skin[:, 1].mean() / 1.5
    assert np.nanmax(beneath[:, 5]) < 0.02


def girths_of(measurements, points):
    """Return girths of the pose as it is, metres."""
    measured = measurements.measure(points[np.newaxis], missing="nan")
    return np.array([measured.values[0][measured.names.index(name)] for name in GIRTHS])


def test_no_clothes(benchmark, registrations):
    """What `clothed=True` costs if there are none."""
    model = registrations[0].model
    bodies = [body for kind, body in people(model) if kind != "of the model"][:10]
    errors, shown = np.empty((2, len(bodies), 2))
    for number, body in enumerate(bodies):
        scan = simulated_scan(body, model.faces, number, n_points=12_000, missing=0.1)
        for k, registration in enumerate(registrations):
            result, *_ = clocked(partial(registration.solve, scan.points), benchmark=benchmark)
            errors[number, k] = np.linalg.norm(result.points - scan.body, axis=1).mean()
            shown[number, k] = result.trusted_vertices.mean()
    print(f"\nwithout clothes: {1000 * errors.mean(axis=0)} mm, trusted {shown.mean(axis=0)}")


def test_wrong_bodies_in_clothes(benchmark, registrations, dressed):
    """How many bodies in forced, wrong poses are trusted."""
    registration, rng = registrations[1], np.random.default_rng(SEED)

    def run():
        return [
            (outfit, start, error, worst, result.trusted, result.message)
            for _, outfit, scan in dressed[::7]
            for start, error, worst, result in results_to_trust_or_not(
                registration, scan.points, scan.body, None, rng
            )
        ]

    rows = benchmark.pedantic(run, rounds=1)
    wrong = [row for row in rows if row[2] > WRONG_METRES]
    trusted = [row for row in wrong if row[4]]
    right = [row for row in rows if row[1] == "search" and row[2] < WRONG_METRES]
    print(f"\n{len(trusted)} of {len(wrong)} wrong bodies in clothes trusted", *trusted, sep="\n")
    print(f"{sum(not row[4] for row in right)} of {len(right)} right ones refused")
    assert len(trusted) <= len(wrong) / 50
