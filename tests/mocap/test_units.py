"""Units of lengths in recordings, by a name or a number."""

import numpy as np
import pytest
from recorded_people import RECORDING

from riemhuman.datasets import load_bvh, retarget
from riemhuman.errors import ArgumentError


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
    with pytest.raises(ArgumentError, match="betas must be 'recorded'|betas must be one of"):
        retarget(recording, betas="tall")
