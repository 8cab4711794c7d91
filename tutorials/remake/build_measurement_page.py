"""Rewrite the page of the documentation that lists the measurements.

    python tutorials/remake/build_measurement_page.py

writes tutorials/measurement_names.md from the definitions that ship; a test compares them.
build_open_measurements.py does so, too.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from riemhuman.measurements import Length, Measurement, MeasurementSet, open_measurements
from riemhuman.measurements.measurement_set import DATA

PAGE = Path(__file__).parents[1] / "measurement_names.md"
_OTHERS = ("ANSUR II", "CAESAR", "SMPL-Anthropometry")
_AGREES = 0.5  # standard deviations among adults

_HEAD = """# Measurements and what others call them

`rh.measurements.open_measurements("full")` holds the standing measurements below, and
`open_measurements("full", pose="seated")` those of people who sit with their forearms forward. A
name after ≈ belongs to a similar measurement; the remark says how it differs. [Tutorial
11](11_measurements.ipynb) shows how to take measurements.

If the standards differ, there is a measurement for each:

- **Waist.** `waist girth` is the natural waist of ISO 8559-1 (between the lowest rib and the iliac
  crest), the narrowest level. ANSUR II and SMPL-Anthropometry measure at the navel: `waist girth
  (omphalion)`. CAESAR's waist is where people wear their trousers. Breadth, depth, height and back
  length exist at both levels.
- **Chest.** `chest girth` is measured horizontally at the bust points, as in ISO 8559-1,
  ISO 7250-1 and ANSUR II. CAESAR also has a girth at the scye, under the arms, which riemhuman
  does not have.
- **Thigh.** `thigh girth` is measured 3 cm below the crotch and across the bone, so that it does
  not change when the leg moves. ISO 8559-1 and ANSUR II measure horizontally, at the fold of the
  buttock.
- **Calf and ankle.** `calf girth` is where the calf of the mean body is thickest, `ankle girth`
  where its leg is thinnest above the malleoli (ANSUR II's ankle). ISO 8559-1 also has an ankle
  girth over the malleoli, which riemhuman does not have.
- **Arm.** Girths are measured on the hanging arm, as in ISO 8559-1; ANSUR II measures the flexed
  arm.

*ISO* gives the standard, ISO 8559-1 of 2017 or ISO 7250-1 of 2008, without clause numbers.
*Level* is the height of the plane or place on the mean body, in per cent of its stature. *Women*
and *men* say by how many millimetres (kilograms) the mean woman and man of the open body model
exceed those of ANSUR II; for {agree} of {count} measurements, both agree to within half a standard
deviation among adults. The coarse model is a polyhedron inside the full one, so the girths of its
limbs are a few centimetres smaller. The seated body is that of the model: its knees bend above the
epicondyles, and its skin loses depth at buttocks and kneecaps, so its thighs are short and thick.
For the seated measurements of a person, `predict_measurements(values, sex)` is more accurate: it
predicts all measurements from a few, with standard deviations, without making a body. `python
tutorials/remake/build_statistics.py ANSUR --check` prints how well measurements predict each
other.

| name | ISO | ANSUR II | CAESAR | SMPL-Anthropometry | level | women | men | remark |
|---|---|---|---|---|---:|---:|---:|---|
"""


def page() -> str:
    """Return the text of the page."""
    adults = json.loads((DATA / "measurements_of_adults.json").read_text(encoding="utf-8"))
    lines = []
    agree = 0
    count = 0
    for pose in ("standing", "seated"):
        definitions = open_measurements("full", pose)
        lines.append(f"| **{pose}** | | | | | | | | |")
        for measurement in definitions.measurements:
            offsets = [adults[sex]["offsets"].get(measurement.name) for sex in ("woman", "man")]
            if offsets[0] is not None:
                number = adults["names"].index(measurement.name)
                count += 1
                agree += all(
                    abs(offset) < _AGREES * adults[sex]["std"][number]
                    for sex, offset in zip(("woman", "man"), offsets, strict=True)
                )
            scale = 1000.0 if measurement.units == "m" else 1.0
            cells = [
                measurement.name,
                measurement.standard,
                *(measurement.equivalents.get(source, "") for source in _OTHERS),
                _level(measurement, definitions) if pose == "standing" else "",
                *("" if o is None else f"{scale * o:+.0f}" for o in offsets),
                measurement.note,
            ]
            lines.append(f"| {' | '.join(cells)} |")
    return _HEAD.format(agree=agree, count=count) + "\n".join(lines) + "\n"


def _level(measurement: Measurement, definitions: MeasurementSet) -> str:
    """Return the height of a section or place in per cent of the mean body's stature."""
    is_level = measurement.places and not isinstance(measurement, Length)
    if not is_level or getattr(measurement, "above", None) is not None:
        return ""
    body = definitions.model(pose=definitions.standard_pose_vector)
    place = measurement.places[0]
    shares = {place: 1.0} if isinstance(place, str) else place
    height = sum(
        share * (definitions.landmarks[name][1] @ body[definitions.landmarks[name][0], 1])
        for name, share in shares.items()
    ) / sum(shares.values())
    return f"{100 * (height - body[:, 1].min()) / np.ptp(body[:, 1]):.1f}"


def main() -> None:
    """Write the page."""
    PAGE.write_text(page(), encoding="utf-8")
    sys.stdout.write(f"{PAGE}\n")


if __name__ == "__main__":
    main()
