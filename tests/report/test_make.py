"""The report: its page, its files, and what is computed again."""

import csv
import json
import re
import shutil
from contextlib import contextmanager
from functools import partial
from html.parser import HTMLParser

import numpy as np
import pytest
from cases import sphere_template, surfaces

from riemhuman.datasets import Bodies, load_open_motions
from riemhuman.errors import ArgumentError, FileError, MissingDependencyError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.report import _path_sections, make_report
from riemhuman.retrieval import benchmark
from riemhuman.surfaces.deformation_basis import DeformationBasis


class Page(HTMLParser):
    """What a page is made of."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.headings, self.data = [], [], []
        self.labels = set()
        self._open = None
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.elements.append((tag, attributes))
        if re.fullmatch("h[1-6]", tag):
            self.headings.append(int(tag[1]))
        if tag == "data":
            self._open = attributes
        if tag == "label":
            self.labels.add(attributes.get("for"))

    def handle_data(self, text):
        if self._open is not None:
            self.data.append((self._open, text))
            self._open = None

    def all(self, *tags):
        return [attributes for tag, attributes in self.elements if tag in tags]


@pytest.fixture(scope="module")
def folder(report_page):
    return report_page.parent


@pytest.fixture(scope="module")
def page(folder):
    return Page((folder / "index.html").read_text(encoding="utf-8"))


def rows_of(folder, table):
    with (folder / "tables" / f"{table}.csv").open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


TASKS = ("shape", "pose")


@pytest.mark.slow
def test_the_page_asks_for_nothing(page):
    for tag, attributes in page.elements:
        for name in ("src", "srcset", "poster", "action"):
            assert attributes.get(name, "data:").startswith("data:"), (tag, attributes)
        address = attributes.get("href", "#")
        assert not re.match(r"\w+:|//", address) or address.startswith("data:")
    text = "".join(attributes.get("style", "") for _, attributes in page.elements)
    assert "url(" not in text


@pytest.mark.slow
def test_links_lead_somewhere(page, folder):
    identifiers = [a["id"] for _, a in page.elements if "id" in a]
    assert len(identifiers) == len(set(identifiers))
    for link in page.all("a"):
        if link["href"].startswith("#"):
            assert link["href"][1:] in identifiers
        else:
            assert (folder / link["href"]).is_file()


@pytest.mark.slow
def test_the_page_can_be_heard_and_driven_by_keys(page):
    assert page.headings[0] == 1
    assert page.headings.count(1) == 1
    assert all(
        after <= before + 1 for before, after in zip(page.headings, page.headings[1:], strict=False)
    )
    assert page.all("html")[0]["lang"] == "en"
    assert len(page.all("main")) == 1
    for image in page.all("img"):
        assert len(image["alt"]) > 20
    for slider in [a for a in page.all("input") if a["type"] == "range"]:
        assert slider["id"] in page.labels
    for canvas in page.all("canvas"):
        assert canvas["tabindex"] == "0"
        assert "arrow keys" in canvas["aria-label"].lower()
    for region in page.all("div"):
        if region.get("role") == "region":
            assert region["tabindex"] == "0"
            assert len(region["aria-label"].split()) > 2  # what it shows, not the name of a file


@pytest.mark.slow
def test_every_number_is_that_of_its_table(page, folder):
    tables = {}
    assert len(page.data) > 100
    for attributes, shown in page.data:
        name = attributes["data-table"]
        rows = tables.setdefault(name, rows_of(folder, name))
        value = rows[int(attributes["data-row"])][attributes["data-column"]]
        assert attributes["value"] == value
        plain = shown.replace("−", "-")
        digits = len(plain.rstrip("%").partition(".")[2])
        scale = 100 if plain.endswith("%") else float(attributes.get("data-scale", 1))
        assert float(plain.rstrip("%")) == pytest.approx(
            scale * float(value), abs=0.500001 * 10**-digits
        )
    assert {"retrieval-shape", "retrieval-pose", "comparison", "geodesics", "mean"} <= set(tables)


@pytest.mark.slow
def test_results_are_those_of_the_library(folder, nine_bodies):
    records = benchmark(nine_bodies)
    for task in TASKS:
        records_of_task = [record for record in records if record.task == task]
        *rows, metric, descriptor = rows_of(folder, f"retrieval-{task}")
        assert (metric["representation"], descriptor["representation"]) == ("offsets", "extents")
        for row, record in zip(rows, records_of_task, strict=True):
            assert row["representation"] == record.representation
            for key in ("nn", "first_tier", "second_tier", "mean_average_precision"):
                assert float(row[key]) == getattr(record.scores, key)
    space = AlignedSurfaces(nine_bodies.template)
    for row in rows_of(folder, "geodesics"):
        weights = [float(weight) for weight in row["metric"].strip("()").split(",")]
        metric = ElasticMetric(space, *weights)
        names = {"one person, two poses": "pose-change", "two people, one pose": "shape-change"}
        name = names.get(row["geodesic"], row["geodesic"].split()[0])
        with np.load(folder / "results" / f"geodesic-{name}.npz") as stored:
            path = stored["path"]
        assert float(row["energy"]) == pytest.approx(metric.energy(path), rel=1e-6)
        assert float(row["squared_distance"]) == metric.squared_dist(path[0], path[-1])
        assert float(row["squared_distance"]) <= float(row["energy"])
        assert float(row["energy"]) <= float(row["straight_energy"])


@pytest.mark.slow
def test_provenance(folder, nine_bodies):
    found = json.loads((folder / "provenance.json").read_text(encoding="utf-8"))
    assert found["status"] == "finished"
    assert found["sizes"]["bodies"] == 9
    assert found["versions"]["numpy"] == np.__version__
    assert found["parameters"]["n_nodes"] == 7
    assert found["seeds"] == {"t-sne": 0}
    assert [step["step"] for step in found["steps"]] == [
        row["step"] for row in rows_of(folder, "steps")
    ]
    assert all(step["seconds"] >= 0 for step in found["steps"])


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_run_again_nothing_is_computed(folder, make_small_report, tmp_path):
    before = (folder / "index.html").read_text(encoding="utf-8")
    again = shutil.copytree(folder, tmp_path / "again")
    make_small_report(again)
    found = json.loads((again / "provenance.json").read_text(encoding="utf-8"))
    assert all(step["reused"] for step in found["steps"])
    after = (again / "index.html").read_text(encoding="utf-8")
    moment = r"\d{4}-\d\d-\d\dT[\d:]+\+00:00"
    assert re.sub(moment, "", after) == re.sub(moment, "", before)


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_stopped_from_the_keyboard_it_goes_on_where_it_was(tmp_path, monkeypatch, nine_bodies):
    def interrupt(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(_path_sections.BasisPath, "solve", interrupt)
    some = partial(load_open_motions, subjects=["lean runner", "average man"])
    monkeypatch.setattr("riemhuman.report._report.load_open_motions", some)
    tasks = []

    @contextmanager
    def watch(name):
        if not name.startswith(("Figure", "Page")):
            tasks.append(name)
        yield

    for _ in "ab":
        with pytest.raises(KeyboardInterrupt):
            make_report(tmp_path / "r", bodies=nine_bodies, quick=True, progress=watch)
    assert not (tmp_path / "r" / "index.html").exists()
    stored = {file.stem for file in (tmp_path / "r" / "results").glob("*.npz")}
    assert stored > {"distances-srnf", "maps", "differences", "basis"}
    # Only what was interrupted is begun again.
    again = "Geodesic, one person, two poses"
    assert [tasks.count(name) for name in tasks] == [2 if name == again else 1 for name in tasks]
    assert len(tasks) > 10


def sections_of(text):
    return [a["id"] for a in Page(text).all("section") if "id" in a]


def chosen_bodies(bodies, numbers, *, labelled=True):
    chosen = bodies[numbers]
    if labelled:
        return chosen
    order = np.arange(len(chosen))
    return Bodies(
        chosen.points, order, order, chosen.template, subject_names=tuple(f"b{k}" for k in order),
        pose_names=("",) * len(order),
    )  # fmt: skip


@pytest.mark.slow
def test_one_or_two_bodies_have_what_they_can_say(undrawn, nine_bodies, tmp_path):
    single = chosen_bodies(nine_bodies, [0])
    one = make_report(tmp_path / "one", bodies=single, quick=True, units="in")
    text = one.read_text(encoding="utf-8")
    (row,) = rows_of(tmp_path / "one", "measurements")
    assert "Stature, in</th>" in text
    assert f">{float(row['stature (m)']) / 0.0254:.1f}</data>" in text
    with pytest.raises(ArgumentError, match="units must be one of"):
        make_report(tmp_path / "none", bodies=single, units="feet")
    assert sections_of(text) == ["measurements", "making"]
    assert "One person in several poses" not in text  # a table of names without values
    two = make_report(tmp_path / "two", bodies=chosen_bodies(nine_bodies, [0, 3]), quick=True)
    text = two.read_text(encoding="utf-8")
    assert sections_of(text) == ["measurements", "differences", "geodesics", "mean", "making"]
    assert "As figure 4 (b) of the paper, two people, one pose" in text
    assert len(rows_of(tmp_path / "two", "measurements")) == 2


@pytest.mark.slow
def test_without_labels_nothing_is_said_of_people_or_poses(undrawn, nine_bodies, tmp_path):
    bodies = chosen_bodies(nine_bodies, slice(None), labelled=False)
    text = make_report(tmp_path / "r", bodies=bodies, quick=True).read_text(encoding="utf-8")
    assert sections_of(text) == ["measurements", "maps", "differences", "geodesics", "making"]
    assert "There are no labels" in text
    assert "permutations" not in text  # of bodies that may be of one person
    assert not re.search(r"<dt>(people|poses)</dt>", text)
    (row, *_) = rows_of(tmp_path / "r", "differences")
    assert row["pair"] == "the two bodies that differ most"
    assert "b0</th>" in text  # not "b0, "


@pytest.mark.slow
def test_maps_open_as_pages_with_bodies(page, folder):
    views = [a["href"] for a in page.all("a") if a["href"].startswith("views/")]
    names = [f"map-{task}-{method}" for method in ("t-sne", "mds") for task in ("shape", "pose")]
    assert views == [f"views/{name}.html" for name in names]
    for view in views:
        text = (folder / view).read_text(encoding="utf-8")
        assert text.count("<circle") == 9
        assert 'data-part="map"' in text


@pytest.mark.slow
def test_bodies_without_model_or_shared_labels(undrawn, tmp_path):
    template = sphere_template()
    points = surfaces(template, 4, size=0.1)
    bodies = Bodies(
        points, subject=[0, 0, 1, 2], pose=[0, 1, 2, 3], template=template,
        subject_names=("Ann <i>", "Bo", "Cy"), pose_names=tuple("abcd"),
    )  # fmt: skip
    index = make_report(tmp_path / "r", bodies=bodies, quick=True)
    text = index.read_text(encoding="utf-8")
    page = Page(text)
    assert "Ann <i>" not in re.sub(r"<script.*?</script>", "", text, flags=re.DOTALL)
    rows = rows_of(tmp_path / "r", "comparison")
    assert [row["name"] for row in rows] == [
        *("linear", "rotating start", "SRNF", "Sobolev, a2 = 0.001", "ours (1, 1, 0)")
    ]
    assert {row["mean_deviation (m)"] for row in rows} == {""}
    # One person alone has two bodies, so there is nothing to retrieve or to map.
    assert {"retrieval", "maps", "sweep"}.isdisjoint(a.get("id") for _, a in page.elements)
    assert not list((tmp_path / "r" / "tables").glob("retrieval-*.csv"))
    assert not list((tmp_path / "r" / "figures").glob("confusion-*"))
    assert "needs at least two people, or two poses, with two bodies each" in text
    assert not (tmp_path / "r" / "figures" / "geodesic-shape-change.svg").exists()
    found = json.loads((tmp_path / "r" / "provenance.json").read_text(encoding="utf-8"))
    assert "mesh harmonics" in found["basis"]
    assert page.headings.count(1) == 1


def test_refusals_leave_nothing_behind(tmp_path, nine_bodies, monkeypatch):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(FileError, match="holds other files"):
        make_report(tmp_path, bodies=nine_bodies)
    template = sphere_template()
    one = Bodies(
        surfaces(template, 1, size=0.1), [0], [0], template,
        subject_names=("Ann",), pose_names=("one",),
    )  # fmt: skip
    with pytest.raises(ArgumentError, match="at least two, or one of the open body.*; found 1"):
        make_report(tmp_path / "new", bodies=one)
    other = DeformationBasis.from_laplacian(sphere_template(), 3)
    with pytest.raises(ArgumentError, match="vertices"):
        make_report(tmp_path / "new", bodies=nine_bodies, basis=other)
    monkeypatch.setitem(__import__("sys").modules, "sklearn.manifold", None)
    with pytest.raises(MissingDependencyError, match=r"\.\[report\]"):
        make_report(tmp_path / "new", bodies=nine_bodies)
    assert [entry.name for entry in tmp_path.iterdir()] == ["thesis.tex"]
