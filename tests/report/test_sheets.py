"""Sheets of people: what they say of a body, where they are drawn, and what a folder holds."""

import csv
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import riemhuman as rh
from riemhuman.errors import ArgumentError, FileError, FileFormatError, MissingDependencyError
from riemhuman.registration.folders import ScanRecord
from riemhuman.report import _sheet_making, printing, sheet_folders
from riemhuman.report import sheets as sheets_module
from riemhuman.report._sheet_content import percentile_text, posture_texts
from riemhuman.report._sheet_pictures import body_pictures, front_facing, silhouette_picture
from riemhuman.report._sheet_subjects import find_subjects, read_people
from riemhuman.report.sheet_values import Average, SheetSubject, values_of


@pytest.fixture(scope="module")
def bodies():
    return rh.datasets.load_open_bodies("coarse", people=2)


@pytest.fixture(scope="module")
def own(bodies):
    return rh.measurements.Measurements(bodies.model)


@pytest.fixture(autouse=True)
def small_pictures(monkeypatch):
    """Draw faster, with a third of the pixels."""

    def render_small(points, faces, *, height, **settings):
        return rh.plots.render(points, faces, height=height // 3, **settings)

    monkeypatch.setattr("riemhuman.report._sheet_pictures.render", render_small)


@pytest.fixture
def no_browser(monkeypatch):
    """Hide browsers from whatever writes PDF files."""
    for module in (printing, sheets_module, sheet_folders):
        monkeypatch.setattr(module, "find_browser", lambda: None)


@pytest.fixture(scope="module")
def record(bodies):
    """Return the record of a scan that lies on its side, and does not show the feet."""
    points = bodies[0]
    shown = points[points[:, 1] > points[:, 1].min() + 0.25]
    transform = np.eye(4)
    transform[:3, :3] = Rotation.from_euler("x", 90, degrees=True).as_matrix()
    in_scan = transform[:3, :3].T
    trusted = points[:, 1] > points[:, 1].min() + 0.25
    return ScanRecord(
        name="half",
        trusted=True,
        message="the feet were not seen (7 % of the body)",
        likelihood=2.0,
        median_distance=0.0021,
        matched_share=0.66,
        arrays={
            "points": points @ in_scan.T,
            "transform": transform,
            "shown": (shown @ in_scan.T).astype(np.float32),
            "trusted_vertices": trusted,
            "faces": bodies.template.faces,
        },
    )


def table_of(folder):
    text = (folder / "measurements.csv").read_text(encoding="utf-8")
    return list(csv.reader(text.splitlines()))


def opaque_rows(pixels):
    return np.flatnonzero(pixels[..., 3].any(axis=1))


def test_a_sheet_says_what_the_body_measures(bodies, own):
    sheet = rh.report.sheet(bodies[3], name="Emma <&>", sex="woman", visit="2026-03-02")
    measured = own.measure(bodies[3], pose="standard", missing="nan")
    assert [row.name for row in sheet.measurements] == list(measured.names)
    np.testing.assert_allclose([row.value for row in sheet.measurements], measured.values)
    stature = sheet.measurements[0]
    assert stature.uncertainty == pytest.approx(
        2 * rh.measurements.noise_of_measurements(["stature"])[0]
    )
    expected = rh.measurements.percentiles({"stature": stature.value}, "woman")["stature"]
    assert stature.percentile == pytest.approx(expected)
    assert sheet.badge == "registered mesh"
    text = f"{100 * stature.value:.1f}"
    assert f">{text}<" in sheet.html.replace(f"{text} ", f"{text}<")
    assert "Emma &lt;&amp;&gt;" in sheet.html
    assert "women of this stature" in sheet.html
    assert "ANSUR II" in sheet.html
    assert sheet._repr_html_().startswith("<iframe srcdoc=")
    # Nothing is fetched: the page works without a network.
    assert not re.search(r"(src|href)=[\"']https?:", sheet.html)


def test_without_a_sex_both_are_meant(bodies):
    sheet = rh.report.sheet(bodies[3])
    assert "sex not given" in sheet.html
    assert "women and men together" in sheet.html


def test_a_child_has_no_percentiles_of_adults(bodies):
    child, unknown = 0.7 * bodies[0], bodies[0]
    sheet = rh.report.sheet(child, sex="woman")
    stature = sheet.measurements[0].value
    assert 1.0 < stature < 1.3
    assert all(np.isnan(row.percentile) for row in sheet.measurements)
    assert f"a stature of {100 * stature:.1f} cm is outside the range of adult women" in sheet.html
    for words in ("pctl.", "how many of 100", "Compared with the average", "percentile</th>"):
        assert words not in sheet.html
        assert words in rh.report.sheet(unknown, sex="woman").html
    assert f"a stature of {stature / 0.0254:.1f} in" in rh.report.sheet(child, units="in").html


def test_names_are_words_of_people(bodies):
    """No anatomists' words, and no two rows of one name; files keep the names of the library."""
    sheet = rh.report.sheet(bodies[0])
    titles = [row.title for row in sheet.measurements]
    assert len(set(titles)) == len(titles)
    jargon = "omphalion|scye|tragion|suprasternale|trochanter|iliocristale|patella|C7|biacromial"
    assert not re.search(jargon, re.sub(r'title="[^"]*"|"data:[^"]*"', "", sheet.html))
    by_title = {row.title: row for row in sheet.measurements}
    assert by_title["Arm length"].name == "arm length"
    assert "waist depth (omphalion)" in {row.name for row in sheet.measurements}


def test_the_share_that_a_scan_shows_is_one_of_the_surface(record, bodies):
    """Hands hold many vertices and little surface."""
    faces = bodies.template.faces
    matched = bodies[0][:, 1] > np.median(bodies[0][:, 1])
    seen = replace(record, arrays=record.arrays | {"matched": matched})
    areas = rh.surfaces.triangle_areas(bodies[0], faces)
    share = areas @ matched[faces].mean(axis=1) / areas.sum()
    assert abs(share - matched.mean()) > 0.02
    sheet = rh.report.sheet(seen)
    assert sheet.badge == f"partly seen: {100 * share:.0f} %"
    assert f"shows {100 * share:.0f} % of the body" in sheet.html


def test_inches_and_pounds(bodies, record):
    assert "from the body is 0.083 in;" in rh.report.sheet(record, units="in").html
    sheet = rh.report.sheet(bodies[0], units="in")
    stature = sheet.measurements[0].value
    assert f"{stature / 0.0254:.1f}" in sheet.html
    assert " lb" in sheet.html or ">lb<" in sheet.html
    with pytest.raises(ArgumentError, match="units must be one of"):
        rh.report.sheet(bodies[0], units="mm")


def test_a_scan_that_shows_only_part_of_a_body(record):
    sheet = rh.report.sheet(record, name="Emma", sex="woman")
    assert sheet.badge == "partly seen: 66 %"
    missing = {row.name for row in sheet.measurements if np.isnan(row.value)}
    assert {"stature", "foot length", "inside leg height"} <= missing
    assert "chest girth" not in missing
    assert "The feet were not seen" in sheet.html
    assert f"{len(missing)} of 85 measurements depend on parts that cannot be trusted" in sheet.html
    assert "2.1 mm" in sheet.html
    assert "The scan" in sheet.html
    # No foot, no angle of it; no stature, no percentile.
    assert np.isnan(sheet.posture["left foot turned out"])
    assert all(np.isnan(row.percentile) for row in sheet.measurements)


def test_a_body_that_is_not_trusted_is_not_measured(record):
    arrays = record.arrays | {"trusted_vertices": np.zeros_like(record.arrays["trusted_vertices"])}
    doubtful = replace(record, trusted=False, message="the body fits poorly", arrays=arrays)
    sheet = rh.report.sheet(doubtful)
    assert sheet.badge == "not trusted"
    assert all(np.isnan(row.value) for row in sheet.measurements)
    assert sheet.posture == {}
    assert "Do not rely on this body" in sheet.html
    assert "The body fits poorly." in sheet.html
    failed = replace(record, trusted=False, message="too few points", arrays={})
    with pytest.raises(ArgumentError, match="was not registered: too few points"):
        rh.report.sheet(failed)


def test_changes_since_a_visit(bodies, own):
    betas = bodies.betas[0].copy()
    later = betas + np.eye(len(betas))[1] * 0.8
    pose = bodies.pose_vectors[0]
    before, after = (bodies.model(each, pose) for each in (betas, later))
    sheet = rh.report.sheet(after, name="Emma", before=before)
    expected = rh.measurements.compare_visits(own, before, after)
    assert sheet.changes is not None
    np.testing.assert_allclose(sheet.changes.changes, expected.changes, atol=1e-9)
    assert "Changes since" in sheet.html
    assert f"{int(expected.is_significant.sum())} of 85 measurements changed" in sheet.html
    assert "hardly the same person" not in sheet.html
    assert rh.report.sheet(after).changes is None


@pytest.mark.filterwarnings("ignore:no PDF:UserWarning")
def test_visits_of_two_people_are_doubted(bodies, folder, tmp_path, no_pdf):
    """The page says so in the words of `riemhuman compare`, and so does a warning."""
    people = rh.measurements.person_distance(bodies[0], bodies[13], bodies.template.faces)
    sheet = rh.report.sheet(bodies[13], name="Emma", before=bodies[0])
    assert people.is_hardly_one_person
    assert f"The two visits show {people.text}." in sheet.html
    rh.save_mesh(folder / "emma_2.ply", bodies[13], bodies.template.faces)
    with pytest.warns(UserWarning, match=re.escape(f"emma_1 and emma_2 are {people.text}")):
        rh.report.make_sheets(folder, tmp_path / "sheets")


@pytest.mark.parametrize("degrees", [0.0, 130.0, -60.0])
def test_pictures_show_the_front_whatever_the_heading(bodies, own, degrees):
    turned = bodies[0] @ Rotation.from_euler("y", degrees, degrees=True).as_matrix().T
    faces = bodies.template.faces
    names = ("left_trochanterion", "right_trochanterion")

    def front_of(points):
        left, right = (
            weights @ points[vertices]
            for vertices, weights in (own.definitions.landmarks[name] for name in names)
        )
        rotation = front_facing(left - right)
        return rotation, body_pictures(SheetSubject("x", points), faces, rotation)[1]

    rotation, picture = front_of(turned + [3.0, 1.0, -2.0])
    # The nose is in front of the back of the head.
    nose, back = (own.definitions.landmarks[name] for name in ("pogonion", "opisthocranion"))
    step = (nose[1] @ turned[nose[0]] - back[1] @ turned[back[0]]) @ rotation.T
    assert step[2] > 0.1
    assert picture.titles == ("front", "side", "back")
    # Feet are at the height 0 of the ruler, the crown is at the stature.
    rows = opaque_rows(picture.pixels)
    heights = picture.high - (rows[[-1, 0]] + [1.0, 0.0]) * picture.metres_per_pixel
    assert heights == pytest.approx([0.0, np.ptp(turned[:, 1])], abs=0.008)


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


def test_the_silhouette_of_the_average_has_no_difference(bodies, own):
    faces = bodies.template.faces
    average = rh.measurements.average_adult(1.65, "woman", "coarse")
    (values,) = values_of(own, [SheetSubject("x", average)], Average("coarse", faces))

    def coloured(standing):
        picture = silhouette_picture(replace(values, standing=standing, average=average), faces)
        red, green, blue, opacity = np.moveaxis(picture.pixels.astype(float), -1, 0)
        return (opacity * (np.ptp([red, green, blue], axis=0) > 40)).sum() / opacity.sum()

    assert coloured(average) < 0.001
    assert coloured(average * [1.15, 1.0, 1.15]) > 0.05


def test_angles_and_percentiles_in_words():
    assert [percentile_text(x) for x in (0.2, 41.6, 99.7, np.nan)] == ["<1", "42", ">99", "–"]
    names = rh.measurements.posture_angles(
        rh.measurements.Measurements(rh.datasets.load_open_model("coarse")),
        rh.datasets.load_open_model("coarse").template.vertices,
    )
    angles = dict.fromkeys(names, 0.0) | {"shoulder tilt": -4.0, "head tilt": np.nan}
    texts = {text.title: text for text in posture_texts(angles)}
    assert (texts["Shoulder tilt"].value, texts["Shoulder tilt"].what) == ("4°", "right higher")
    assert texts["Head tilt"].value == "–"


def test_a_body_on_its_back_has_no_posture(bodies, own):
    lying = bodies[0][:, [0, 2, 1]] * [1.0, 1.0, -1.0]
    sheet = rh.report.sheet(lying)
    assert sheet.posture == {}
    assert "another axis points up" in sheet.html


def pages_of(file):
    return len(re.findall(rb"/Type\s*/Page\b", file.read_bytes()))


def test_both_files_of_a_sheet(record, tmp_path, no_browser):
    sheet = rh.report.sheet(record, name="Emma $1 and some more words " * 4, sex="woman")
    sheet.save(tmp_path / "emma.html")
    sheet.save(tmp_path / "emma.pdf")
    assert (tmp_path / "emma.html").read_text(encoding="utf-8") == sheet.html
    assert pages_of(tmp_path / "emma.pdf") == 2
    with pytest.raises(FileFormatError, match=r"must be \.html or \.pdf"):
        sheet.save(tmp_path / "emma.txt")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["emma.html", "emma.pdf"]


@pytest.mark.slow
def test_the_browser_prints_two_sides(bodies, record, tmp_path):
    if printing.find_browser() is None:
        pytest.skip("there is no browser")
    later = bodies[0] * [1.04, 1.0, 1.04]
    for sheet in (rh.report.sheet(record), rh.report.sheet(later, before=bodies[0])):
        sheet.save(tmp_path / "sheet.pdf")
        assert pages_of(tmp_path / "sheet.pdf") == 2
        assert b"Skia" in (tmp_path / "sheet.pdf").read_bytes()
    assert [file.name for file in tmp_path.iterdir()] == ["sheet.pdf"]


def test_a_browser_that_fails_leaves_it_to_matplotlib(bodies, tmp_path, monkeypatch):
    monkeypatch.setattr(sheets_module, "find_browser", lambda: "/no/such/browser")
    rh.report.sheet(bodies[0]).save(tmp_path / "sheet.pdf")
    assert pages_of(tmp_path / "sheet.pdf") == 2


# Folders.


@pytest.fixture
def folder(bodies, tmp_path):
    """Return a folder with two visits of one person, another person, and labels."""
    place = tmp_path / "bodies"
    place.mkdir()
    for name, number in (("emma_1", 0), ("emma_2", 3), ("index", 12)):
        rh.save_mesh(place / f"{name}.ply", bodies[number], bodies.template.faces)
    rows = ["file;person;sex;date", "emma_2.ply;Emma;F;2026-06-01", "emma_1;Emma;woman;2026-02-28"]
    (place / "labels.csv").write_text("\n".join([*rows, "index.ply;=Ada;;"]), encoding="utf-8")
    return place


@pytest.fixture
def no_pdf(monkeypatch):
    """Make no PDF files, which take most of the time."""

    def missing():
        raise MissingDependencyError("pip install")

    monkeypatch.setattr(sheet_folders, "check_printing", missing)


@pytest.mark.filterwarnings("ignore:no PDF:UserWarning")
def test_a_folder_of_sheets(folder, tmp_path, no_pdf, own, bodies):
    page = rh.report.make_sheets(folder, tmp_path / "sheets")
    names = {"index.html", "measurements.csv", "emma_1.html", "emma_2.html", "index_2.html"}
    written = {file.name for file in page.parent.iterdir()}
    assert written - {"measurements.xlsx"} == names
    text = page.read_text(encoding="utf-8")
    assert re.findall(r"<button>(\w+)", text)[:5] == ["Name", "Sex", "Visit", "Trust", "Stature"]
    for name in names - {"index.html"}:
        assert f'href="{name}"' in text
    rows = table_of(tmp_path / "sheets")
    table = [dict(zip(rows[0], row, strict=True)) for row in rows[1:]]
    assert [row["name"] for row in table] == ["emma_1", "emma_2", "index"]
    assert [row["sex"] for row in table] == ["woman", "woman", "adult"]
    assert table[2]["person"] == "'=Ada"  # no formula
    measured = own.measure(bodies.points[[0, 3, 12]], pose="standard", missing="nan")
    for column in ("stature", "waist girth"):
        np.testing.assert_allclose(
            [float(row[f"{column} (m)"]) for row in table], measured[column], atol=1e-6
        )
    assert float(table[0]["body mass (kg)"]) == pytest.approx(measured["body mass"][0])
    later = (tmp_path / "sheets" / "emma_2.html").read_text(encoding="utf-8")
    assert "Changes since 2026-02-28" in later
    assert "Changes since" not in (tmp_path / "sheets" / "emma_1.html").read_text(encoding="utf-8")


@pytest.mark.filterwarnings("ignore:no PDF:UserWarning")
def test_the_workbook_holds_the_same(folder, tmp_path, no_pdf):
    openpyxl = pytest.importorskip("openpyxl")
    rh.report.make_sheets(folder, tmp_path / "sheets")
    book = openpyxl.load_workbook(tmp_path / "sheets" / "measurements.xlsx")
    assert book.sheetnames == ["Measurements", "Percentiles", "Uncertainty", "Posture", "Changes"]
    header, *rows = book["Measurements"].iter_rows(values_only=True)
    table = table_of(tmp_path / "sheets")
    column = header.index("hip girth (m)")
    of_csv = table[0].index("hip girth (m)")
    assert [row[column] for row in rows] == pytest.approx([float(row[of_csv]) for row in table[1:]])


def test_nothing_is_left_of_what_fails(folder, bodies, tmp_path, no_pdf, monkeypatch):
    output = tmp_path / "sheets"

    def fail(*arguments):
        raise FileError("the disk is full")

    with monkeypatch.context() as broken:
        broken.setattr(sheet_folders, "index_page", fail)
        with (
            pytest.raises(FileError, match="the disk is full"),
            pytest.warns(UserWarning, match="no PDF is written"),
        ):
            rh.report.make_sheets([folder / "emma_1.ply"], output)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["bodies"]
    output.mkdir()
    (output / "thesis.doc").touch()
    with pytest.raises(FileError, match="something else"):
        rh.report.make_sheets(folder, output, replace_output=True)


@pytest.mark.filterwarnings("ignore:no PDF:UserWarning")
def test_an_earlier_result_is_kept_unless_asked(folder, tmp_path, no_pdf):
    output = tmp_path / "sheets"
    output.mkdir()
    (output / "gone.html").touch()
    with pytest.raises(FileError, match="earlier result"):
        rh.report.make_sheets([folder / "emma_1.ply"], output)
    rh.report.make_sheets([folder / "emma_1.ply"], output, replace_output=True)
    assert not (output / "gone.html").exists()
    assert (output / "emma_1.html").exists()


def test_without_openpyxl_the_table_is_there(folder, tmp_path, monkeypatch):
    def missing(module, extra):
        raise MissingDependencyError(f"pip install '.[{extra}]'")

    monkeypatch.setattr(sheet_folders, "import_optional", missing)
    monkeypatch.setattr(sheet_folders, "save_pdf", lambda content, file, browser: None)
    monkeypatch.setattr(sheet_folders, "check_printing", lambda: None)
    with pytest.warns(
        UserWarning, match=r"measurements\.xlsx is not written: pip install '\.\[sheet\]'"
    ):
        rh.report.make_sheets([folder / "emma_1.ply"], tmp_path / "sheets")
    assert (tmp_path / "sheets" / "measurements.csv").exists()


def test_other_bodies_are_refused(bodies, tmp_path):
    rh.save_mesh(tmp_path / "mm.ply", 1000.0 * bodies[0], bodies.template.faces)
    with pytest.raises(
        ArgumentError, match=r"mm\.ply is .* but a body in millimetres would be; .* --unit"
    ):
        rh.report.make_sheets(tmp_path / "mm.ply", tmp_path / "sheets")
    rh.save_mesh(tmp_path / "box.ply", np.random.default_rng(0).random((4, 3)), [[0, 1, 2]])
    with pytest.raises(FileError, match=r"box\.ply has .* register it first"):
        rh.report.make_sheets(tmp_path / "box.ply", tmp_path / "sheets")


def test_labels_of_people(tmp_path):
    table = tmp_path / "labels.csv"
    table.write_text("File,Subject,Gender\nA.PLY,Ann,Female\nb,Bo,m\nc.ply,,\n", encoding="utf-8")
    people = read_people(table)
    assert (people["a.ply"].person, people["a"].sex, people["b"].sex) == ("Ann", "woman", "man")
    assert people["c.ply"].sex == "adult"
    for text, message in (
        ("name,sex\na,woman\n", "has no column file"),
        ("file,sex\na,robot\n", "line 2: sex must be woman, man or empty; found 'robot'"),
        ("file,date\na,01.02.2026\n", "line 2: date must be written as 2026-03-31"),
        ("file,sex\na,man\nA,woman\n", "line 3: A has another line above"),
    ):
        table.write_text(text, encoding="utf-8")
        with pytest.raises(FileFormatError, match=message):
            read_people(table)


def test_the_visit_before(bodies, tmp_path):
    for name in "abcd":
        rh.save_mesh(tmp_path / f"{name}.ply", bodies[0], bodies.template.faces)
    table = tmp_path / "labels.csv"
    table.write_text("file,person,visit\na,x,10\nb,x,9\nc,x,2\nd,y,1\n", encoding="utf-8")
    found = find_subjects([tmp_path], None)
    assert [found.earlier(number) for number in range(4)] == [1, 2, None, None]
    assert found.subjects[0].visit == "visit 10"
    assert not any(found.is_without_order(number) for number in range(4))
    # Several bodies of one visit, or visits that are not told apart, are not compared.
    table.write_text("file,person,visit\na,x,1\nb,x,1\nc,x,\nd,,\n", encoding="utf-8")
    found = find_subjects([tmp_path], None)
    assert [found.earlier(number) for number in range(4)] == [None] * 4
    assert [found.is_without_order(number) for number in range(4)] == [True, True, True, False]
    table.write_text("file,person\na,x\nz,y\n", encoding="utf-8")
    with pytest.warns(UserWarning, match=r"labels\.csv names 1 of the 4 bodies"):
        find_subjects([tmp_path], None)


@pytest.mark.filterwarnings("ignore:no PDF:UserWarning")
def test_registered_scans_come_with_their_scans(record, bodies, tmp_path, no_pdf):
    """Also those that are not trusted, and the reason why there is no body."""
    from riemhuman.registration.folders import _write

    place = tmp_path / "registered"
    (place / "registrations").mkdir(parents=True)
    arrays = record.arrays | {"up": np.array([0.0, 1.0, 0.0]), "matched": np.ones(1202, bool)}
    fits = {"betas": np.zeros(3), "pose": np.zeros(3), "trans": np.zeros(3), "hands": np.zeros(3)}
    shown = {"shown_distances": np.zeros(len(arrays["shown"]), np.float32)}
    whole = replace(record, arrays=arrays | fits | shown)
    _write(place, whole, "key", None)
    _write(place, replace(whole, name="bad", trusted=False, message="no person"), "key", None)
    _write(
        place, replace(record, name="none", trusted=False, message="empty", arrays={}), "k", None
    )
    page = rh.report.make_sheets(place, tmp_path / "sheets")
    text = page.read_text(encoding="utf-8")
    assert "1 partly seen, 1 not trusted" in text
    assert "<strong>none</strong>: empty" in text
    one = (tmp_path / "sheets" / "half.html").read_text(encoding="utf-8")
    assert "The scan from three sides" in one
    # One file of such a folder, too, is found with its scan.
    found = find_subjects([place / "partial" / "half.ply"], None)
    assert found.subjects[0].scan is not None


@pytest.mark.filterwarnings("ignore:no PDF:UserWarning")
def test_the_index_has_no_empty_columns(folder, tmp_path, no_pdf):
    (folder / "labels.csv").unlink()
    text = rh.report.make_sheets(folder / "emma_1.ply", tmp_path / "sheets").read_text("utf-8")
    assert re.findall(r"<button>(\w+)", text)[:3] == ["Name", "Trust", "Stature"]
    # The row of the one body begins with a picture and a heading.
    assert text.count('<th scope="col"') == text.count("<td") + text.count('<th scope="row"')


def test_the_version_is_on_the_sheet(bodies):
    assert f"riemhuman {_sheet_making.library_version()}" in rh.report.sheet(bodies[0]).html
