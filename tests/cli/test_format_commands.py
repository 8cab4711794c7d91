"""The table of the files that are read."""

import json
from pathlib import Path
from typing import get_type_hints

import riemhuman as rh
from riemhuman.cli._format_commands import file_kinds

KINDS = file_kinds()
PAGE = Path(__file__).parents[2] / "tutorials" / "bring_your_data.md"


def test_the_page_has_the_table(run):
    page = PAGE.read_text(encoding="utf-8")
    shown = page.split("<!-- formats -->")[1].split("<!-- end of formats -->")[0]
    rows = json.loads(run("formats", "--json").out)
    lines = [[*rows[0]], ["---"] * len(rows[0]), *([*row.values()] for row in rows)]
    assert shown.strip() == "\n".join(f"| {' | '.join(line)} |" for line in lines)


def test_readers_have_their_names_and_return_motions_or_not():
    for kind in KINDS:
        place = rh
        for name in kind.reader_name.split("."):
            place = getattr(place, name)
        assert place == kind.reader
        assert ("Motion" in str(get_type_hints(kind.reader)["return"])) == kind.is_motion, kind.name


def test_files_are_written_back(bodies, tmp_path):
    (motion,) = rh.datasets.load_open_motions("coarse", "lean runner", "knees", 5)
    for number, kind in enumerate(KINDS):
        for ending in kind.written:
            file = tmp_path / f"file_{number}{ending}"
            if kind.is_motion:
                motion.save(file)
            elif kind.reader == rh.BodyModel.from_file:
                bodies.model.save(file)
            else:
                rh.save_mesh(file, bodies[0], bodies.template.faces)
            assert file.stat().st_size
