"""Units of lengths in recordings: given by a name or a number, or guessed."""

import numpy as np
import pytest
from recorded_people import RECORDING, scaled

from riemhuman.datasets import load_bvh, retarget
from riemhuman.errors import ArgumentError

CMU = 0.0254 / 0.45


def test_units_are_guessed_with_a_warning(recording):
    metres = scaled(recording, CMU)
    for name, factor in (("metres", 1.0), ("centimetres", 100.0), ("feet", 1 / 0.3048)):
        said = f"lengths were taken to be in {name}, .* pass unit="
        with pytest.warns(UserWarning, match=said) as warned:
            motion = retarget(scaled(metres, factor), scale="recorded", frames_per_second=3)
        assert {warning.filename for warning in warned} == {__file__}
        assert motion.errors.scale == pytest.approx(1.0 / factor, rel=1e-6)
    with pytest.warns(UserWarning, match="units of CMU"):
        retarget(recording, scale="recorded")


@pytest.mark.parametrize(
    ("unit", "metres"), [("cm", 0.01), ("Inches", 0.0254), ("foot", 0.3048), ("mm", 0.001), (2, 2)]
)
def test_files_are_read_in_a_unit(recording, unit, metres):
    if unit == "Inches":
        read = load_bvh(RECORDING, unit=unit)
    else:  # the file is in another one
        with pytest.warns(UserWarning, match="m large in its unit, as no person is"):
            read = load_bvh(RECORDING, unit=unit)
    np.testing.assert_allclose(read.positions, metres * recording.positions)
    assert read.unit == "metres"
    assert recording.unit is None


def test_wrong_units(recording):
    with pytest.raises(ArgumentError, match="unit must be one of 'metres', .*; found 'cubits'"):
        load_bvh(RECORDING, unit="cubits")
    with pytest.raises(ArgumentError, match="unit must be .*found -1"):
        retarget(recording, unit=-1)
    with pytest.raises(ArgumentError, match="scale must be one of 'adult', 'recorded'; found 2"):
        retarget(recording, scale=2)
    with pytest.raises(ArgumentError, match="betas must be 'recorded'|betas must be one of"):
        retarget(recording, betas="tall")
