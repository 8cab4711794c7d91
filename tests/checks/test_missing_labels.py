"""Missing labels of every kind are refused by whatever takes labels, as tables of labels do."""

import numpy as np
import pandas
import pytest
from cases import sphere_template, surfaces

import riemhuman as rh
from riemhuman.checks.labels import class_numbers, label_list
from riemhuman.errors import ArgumentError, ArgumentTypeError, FileFormatError
from riemhuman.retrieval import precision_recall, scores

N_POINTS, MISSING = 12, 4
TEXT = ["a", "b", "c"] * 4
NUMBERS = [0, 1, 2] * 4


def with_missing(labels, value):
    """Return a list of labels of which one is missing."""
    return [value if k == MISSING else label for k, label in enumerate(labels)]


KINDS = {
    "None": with_missing(TEXT, None),
    "None among numbers": with_missing(NUMBERS, None),
    "NaN among text": with_missing(TEXT, np.nan),
    "an array with NaN": np.array(with_missing(NUMBERS, np.nan)),
    "arrays of no dimension": [np.array(label) for label in with_missing(NUMBERS, np.nan)],
    "NaT": np.array(with_missing(["2020", "2021", "2022"] * 4, "NaT"), "datetime64[Y]"),
    "masked": with_missing(NUMBERS, np.ma.masked),
    "NA": with_missing(TEXT, pandas.NA),
    "nullable integers": pandas.Series(with_missing(NUMBERS, None), dtype="Int64"),
    "categories": pandas.Categorical(with_missing(TEXT, None)),
    "empty text": with_missing(TEXT, ""),
    "blank text": np.array(with_missing(TEXT, " ")),
    "part of a pair": [("x", label) for label in with_missing(NUMBERS, np.nan)],
}

DISTANCES = np.random.default_rng(0).random((N_POINTS, N_POINTS))
DISTANCES = DISTANCES + DISTANCES.T
FIRST = np.arange(N_POINTS) % 2
TEMPLATE = sphere_template()
POINTS = surfaces(TEMPLATE, N_POINTS)


def bodies_with(labels):
    return rh.datasets.Bodies(
        points=POINTS,
        template=TEMPLATE,
        subject=labels,
        subject_names=tuple("abc"),
        pose=NUMBERS,
        pose_names=tuple("abc"),
    )


class LabelledBodies:
    """Surfaces of another package, which checks no labels."""

    def __init__(self, labels):
        self.points, self.template = POINTS, TEMPLATE
        self.subject, self.pose = labels, None

    def __len__(self):
        return N_POINTS


def learned():
    return rh.LearnedMetric(rh.ElasticMetric(rh.AlignedSurfaces(TEMPLATE), 0.0, 0.0, 1.0))


def regression(labels):
    space = rh.AlignedSurfaces(TEMPLATE)
    space.equip_with_metric(rh.ElasticMetric, a=1.0, lam=1.0, c=0.1)
    return rh.statistics.regress_shape(space, np.arange(12.0), POINTS, people=labels)


FUNCTIONS = {
    "scores": lambda labels: scores(DISTANCES, labels),
    "precision_recall": lambda labels: precision_recall(DISTANCES, labels),
    "LearnedMetric.fit": lambda labels: learned().fit(POINTS, labels),
    "LearnedMetric.held_out_distances": lambda labels: learned().held_out_distances(
        POINTS, TEXT, labels
    ),
    "units of a test": lambda labels: rh.statistics.two_sample_test(
        DISTANCES, FIRST == 0, units=labels
    ),
    "people of a regression": regression,
    "Bodies": bodies_with,
    "benchmark": lambda labels: rh.retrieval.benchmark(LabelledBodies(labels), {}),
}


IS_REFUSED = {"match": r"\[4\] is missing, .*the first of 1 missing labels"}


@pytest.mark.everyday
@pytest.mark.parametrize("kind", KINDS)
def test_labels_of_every_kind_can_be_missing(kind):
    with pytest.raises(ArgumentError, **IS_REFUSED):
        label_list(KINDS[kind], "labels", N_POINTS)


@pytest.mark.everyday
@pytest.mark.parametrize("function", FUNCTIONS)
def test_missing_labels_are_refused_by_what_takes_labels(function):
    with pytest.raises(ArgumentError, **IS_REFUSED):
        FUNCTIONS[function](KINDS["NaN among text"])


def test_checks_of_data_sets_find_missing_labels():
    assert not rh.testing.check_dataset(LabelledBodies(KINDS["NaN among text"])).passed
    assert rh.testing.check_dataset(LabelledBodies(TEXT)).passed


def test_tables_have_the_same_rule(tmp_path):
    table = tmp_path / "labels.csv"
    table.write_text("file,subject,pose\na,anna,sits\nb,,sits\nc,anna, \n", encoding="utf-8")
    with pytest.raises(FileFormatError, match="line 3: no subject given"):
        rh.datasets.read_labels(table, ["a", "b", "c"])
    chosen, labels = rh.datasets.read_labels(table, ["a", "b", "c"], allow_missing=True)
    assert chosen == [0]
    assert labels == {"subject": ["anna"], "pose": ["sits"]}


class Tensor:
    """A tensor as others have it: iterating gives tensors, each equal to itself alone."""

    def __init__(self, values):
        self.values, self.shape, self.ndim = values, np.shape(values), np.ndim(values)
        self.item = lambda: self.values

    def __iter__(self):
        return iter([Tensor(value) for value in self.values])

    def __array__(self, dtype=None, copy=None):
        raise RuntimeError("Can't call numpy() on Tensor that requires grad.")


@pytest.mark.parametrize(
    "labels",
    [
        Tensor(NUMBERS),
        [np.array(label) for label in NUMBERS],
        pandas.Series(NUMBERS, dtype="Int64"),
        pandas.Categorical(TEXT),
        iter(NUMBERS),
        "abc" * 4,
    ],
)
def test_labels_of_any_container(labels):
    numbers, classes = class_numbers(labels, "labels", N_POINTS)
    np.testing.assert_array_equal(numbers, NUMBERS)
    assert len(classes) == 3


@pytest.mark.everyday
@pytest.mark.parametrize(
    "labels",
    [
        np.zeros((12, 1)),
        pandas.DataFrame({"subject": NUMBERS}),
        dict.fromkeys(range(12)),
        [[1]] * 12,
        5,
        None,
    ],
)
def test_what_holds_no_labels_is_refused(labels):
    with pytest.raises(ArgumentTypeError, match="labels must be a sequence of .*class labels"):
        label_list(labels, "labels", N_POINTS)
