"""Checks of a data set: every property tells a broken one."""

import numpy as np
from open_bodies import coarse_bodies
from third_party import Crowd

from riemhuman.testing import check_dataset


def broken(**changes):
    crowd = Crowd(coarse_bodies()[:6])
    for name, value in changes.items():
        setattr(crowd, name, value)
    return crowd


class Reversed:
    """Points whose slices run the other way."""

    def __init__(self, points):
        self.points = points

    def __len__(self):
        return len(self.points)

    def __getitem__(self, index):
        return self.points[index][::-1] if isinstance(index, slice) else self.points[index]


def test_every_property_tells_a_broken_data_set():
    points = coarse_bodies().points[:6]
    spoilt = points.copy()
    spoilt[0, 0] = np.nan
    twins = {
        "it is as long as its points": broken(points=points[:5]),
        "surfaces have the template's vertices": broken(points=points[:, :-1]),
        "vertices are finite": broken(points=spoilt),
        "slices of points are those points": broken(points=Reversed(points)),
        "there is a label for every surface": broken(subject=[0, 1]),
    }
    for name, crowd in twins.items():
        assert name in [check.name for check in check_dataset(crowd).failures]
    del (lacking := broken()).template
    (failure,) = check_dataset(lacking).failures
    assert failure.name == "it has points, template, subject and pose"
    assert len(check_dataset(broken()).checks) == len(twins) + 1
