"""How long measuring and bodies from measurements take, and how well measurements repeat.

    pytest tests/benchmarks/test_measurements.py --benchmark-enable -s

prints, for both resolutions, the processor times to measure one body and to find bodies with given
measurements, of which one contradicts itself, and to predict measurements without a body.

Then, for simulated people in ten poses with a millimetre of noise on their vertices, it prints how
much the lengths and girths of one person vary over poses in the standard pose, how they differ from
those of the person made in that pose, and their slopes against these: medians over measurements,
if all that a body differs from its fit by least squares is transferred, and if flesh near bent
joints belongs to the pose, as `in_standard_pose` has it.
"""

import numpy as np
import pytest
from people_whose_flesh_moves import people_whose_flesh_moves
from performances import clocked

import riemhuman as rh
from riemhuman.measurements import standard_pose

FOUR = {"stature": 1.63, "chest girth": 0.95, "waist girth (omphalion)": 0.87, "hip girth": 1.02}
REQUESTS = {
    "four measurements of a woman": (FOUR, "woman"),
    "stature and mass of a man": ({"stature": 1.8, "body mass": 80.0}, "man"),
    "stature": ({"stature": 1.7}, "adult"),
    "five that contradict each other": (FOUR | {"inside leg height": 0.95}, "woman"),
}


def milliseconds(function, repetitions):
    function()  # compiles
    return 1e3 * clocked(function, repetitions)[2]


@pytest.mark.parametrize("resolution", ["coarse", "full"])
def test_times(benchmark, resolution):
    bodies = rh.datasets.load_open_bodies(resolution)
    measurements = rh.measurements.Measurements(bodies.model)
    benchmark.pedantic(measurements.measure, (bodies[0],), rounds=10, warmup_rounds=1)
    measure = milliseconds(lambda: measurements.measure(bodies[0]), 10)
    slopes = milliseconds(lambda: measurements.measure(bodies[0], gradient=True), 5)
    print(f"\n{resolution}: measure {measure:.0f} ms, with derivatives {slopes:.0f} ms")
    for what, request in REQUESTS.items():
        find = milliseconds(
            lambda request=request: rh.measurements.model_from_measurements(
                *request, resolution=resolution
            ),
            3,
        )
        predict = milliseconds(
            lambda request=request: rh.measurements.predict_measurements(*request), 5
        )
        print(f"{what}: body {find:.0f} ms, prediction {predict:.1f} ms")


# Seed, strength and waves of people whose flesh moves.
FLESH = [(21, 0.8, 0.004), (22, 1.2, 0.002), (23, 1.6, 0.002)]


@pytest.mark.filterwarnings("ignore::riemhuman.errors.ConvergenceWarning")  # one fit of 60
@pytest.mark.parametrize("people", FLESH)
def test_repeatability_in_the_standard_pose(benchmark, monkeypatch, people):
    seed, strength, waves = people
    found = people_whose_flesh_moves(seed, 6, strength, waves=waves)
    noise = 0.001 * np.random.default_rng(1).standard_normal(found.points.shape)
    measurements = rh.measurements.Measurements(rh.datasets.load_open_model("coarse"))
    is_length = np.array(measurements.units) == "m"
    at_rest = measurements.measure(found.at_rest, axes="space", missing="nan").values

    def run():
        straight = rh.measurements.in_standard_pose(measurements.definitions, found.points + noise)
        return measurements.measure(straight, axes="space", missing="nan").values

    print(f"\nseed {seed}, strength {strength:g}, waves of {1000 * waves:g} mm")
    spreads, fields = [], standard_pose._Fields
    flesh = fields.flesh
    for name in ("all", "as it is"):
        with monkeypatch.context() as patch:
            if name == "all":
                patch.setattr(fields, "refit", lambda self, motions, trans, *_: (motions, trans))
                patch.setattr(fields, "flesh", lambda self, _: flesh(self, self.standard_pose))
            values = run()
        by_person = values.reshape(len(at_rest), -1, values.shape[-1])
        spread = 1e3 * np.sqrt(np.nanmean(np.nanvar(by_person, axis=1, ddof=1), axis=0))
        errors = 1e3 * np.sqrt(np.nanmean((by_person - at_rest[:, None]) ** 2, axis=(0, 1)))
        centred = at_rest - np.nanmean(at_rest, axis=0)
        products = np.nansum(centred * np.nanmean(by_person, axis=1), axis=0)
        slopes = products / np.nansum(centred**2, axis=0)
        spreads.append(np.median(spread[is_length]))
        print(
            f"| {name} | sd {spreads[-1]:.2f} mm | error {np.median(errors[is_length]):.2f} mm "
            f"| slope {np.median(slopes):.3f} |"
        )
    benchmark.pedantic(lambda: None)
    assert spreads[1] < 0.9 * spreads[0]
