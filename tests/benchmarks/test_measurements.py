"""How long measuring and bodies from measurements take.

    pytest tests/benchmarks/test_measurements.py --benchmark-enable -s

prints, for both resolutions, the processor times to measure one body and to find bodies with given
measurements, of which one contradicts itself, and to predict measurements without a body.
"""

from time import process_time

import pytest

import riemhuman as rh

FOUR = {"stature": 1.63, "chest girth": 0.95, "waist girth (omphalion)": 0.87, "hip girth": 1.02}
REQUESTS = {
    "four measurements of a woman": (FOUR, "woman"),
    "stature and mass of a man": ({"stature": 1.8, "body mass": 80.0}, "man"),
    "stature": ({"stature": 1.7}, "adult"),
    "five that contradict each other": (FOUR | {"inside leg height": 0.95}, "woman"),
}


def milliseconds(function, repetitions):
    times = []
    for _ in range(repetitions + 1):
        start = process_time()
        function()
        times.append(1e3 * (process_time() - start))
    return min(times[1:])


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
