"""Pictures on a sheet: what faces forward, and what stands at which height."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import riemhuman as rh
from riemhuman.report._sheet_pictures import body_pictures, front_of, silhouette_picture
from riemhuman.report.sheet_values import SheetSubject, values_of


def opaque_rows(pixels):
    return np.flatnonzero(pixels[..., 3].any(axis=1))


@pytest.mark.parametrize("degrees", [0.0, 130.0, -60.0])
def test_pictures_show_the_front_whatever_the_heading(bodies, measurements, degrees):
    turned = bodies[0] @ Rotation.from_euler("y", degrees, degrees=True).as_matrix().T
    moved = turned + [3.0, 1.0, -2.0]
    rotation = front_of(moved, measurements.definitions)
    _, picture = body_pictures(SheetSubject("x", moved), bodies.template.faces, rotation)
    # The nose is in front of the back of the head.
    nose, back = (
        measurements.definitions.landmarks[name] for name in ("pogonion", "opisthocranion")
    )
    step = (nose[1] @ turned[nose[0]] - back[1] @ turned[back[0]]) @ rotation.T
    assert step[2] > 0.1
    assert picture.titles == ("front", "side", "back")
    # Feet are at the height 0 of the ruler, the crown is at the stature.
    rows = opaque_rows(picture.pixels)
    heights = picture.high - (rows[[-1, 0]] + [1.0, 0.0]) * picture.metres_per_pixel
    assert heights == pytest.approx([0.0, np.ptp(turned[:, 1])], abs=0.008)
    for pixels, centimetres in picture.marks("cm"):
        marked = picture.high - pixels * picture.metres_per_pixel
        assert marked == pytest.approx(0.01 * centimetres)


def test_scan_and_body_share_viewpoint_and_scale(bodies):
    seen = rh.registration.simulated_scan(
        bodies[0], bodies.template.faces, rng=0, n_points=4000, noise=0.0, missing=0.0, rotate=False
    )
    subject = SheetSubject("x", bodies[0], scan=seen.points)
    scan, body = body_pictures(subject, bodies.template.faces, np.eye(3))
    assert scan is not None
    assert scan.pixels.shape == body.pixels.shape
    first, second = (picture.pixels[..., 3] > 128 for picture in (scan, body))
    assert (first & second).sum() / (first | second).sum() > 0.8


def test_the_silhouette_of_the_average_has_no_difference(bodies, measurements):
    faces = bodies.template.faces
    average = rh.measurements.average_adult(1.65, "woman", "coarse")
    (values,) = values_of(measurements, [SheetSubject("x", average)])

    def coloured(standing):
        picture = silhouette_picture(replace(values, standing=standing, average=average), faces)
        red, green, blue, opacity = np.moveaxis(picture.pixels.astype(float), -1, 0)
        return (opacity * (np.ptp([red, green, blue], axis=0) > 40)).sum() / opacity.sum()

    assert coloured(average) < 0.001
    assert coloured(average * [1.15, 1.0, 1.15]) > 0.05
