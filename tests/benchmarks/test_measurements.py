"""How well measurements repeat.

    pytest tests/benchmarks/test_measurements.py --benchmark-enable -s

prints, for simulated people in ten poses with a millimetre of noise on their vertices, how much
the lengths and girths of one person vary over poses in the standard pose, how they differ from
those of the person made in that pose, and their slopes against these: medians over measurements,
if all that a body differs from its fit by least squares is transferred, and if flesh near bent
joints belongs to the pose, as `in_standard_pose` has it.
"""

import numpy as np
import pytest
from people_whose_flesh_moves import people_whose_flesh_moves

import riemhuman as rh
from riemhuman.measurements import standard_pose

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
