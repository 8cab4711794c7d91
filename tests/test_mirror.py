"""Source and test files have the same names, or README.md says where; no private name is set."""

import re
from pathlib import Path

TESTS = Path(__file__).parent
SOURCE = TESTS.parent / "riemhuman"
SETS_A_PRIVATE_NAME = re.compile(
    r"""(setattr|patch|patch\.object)\([^()]*["'.]_[a-z]\w*["']|(?<!\bself)\._[a-z]\w* = """, re.I
)


README = (TESTS / "README.md").read_text(encoding="utf-8")


def test_test_files_are_named_after_source_files():
    unlisted = []
    for file in TESTS.rglob("test_*.py"):
        folder, name = SOURCE / file.parent.relative_to(TESTS), file.stem.removeprefix("test_")
        places = [folder / f"{name}.py", folder / f"_{name}.py", folder / name]
        if folder.exists() and not any(place.exists() for place in places):
            unlisted.append(file.relative_to(TESTS).as_posix())
    assert [name for name in unlisted if f"`{name}`" not in README] == []


def test_every_public_module_has_a_test_file():
    untested = []
    for file in SOURCE.rglob("*.py"):
        name = file.relative_to(SOURCE)
        test = TESTS / name.parent / f"test_{name.name}"
        if not (name.name.startswith("_") or test.exists()):
            places = [name.as_posix(), f"{name.parent.as_posix()}/"]
            untested += [places[0]] * all(f"`{place}`" not in README for place in places)
    assert untested == []


def test_no_test_sets_a_private_name():
    for line in ("module._x = 1", "patch('module._x')", "patch.object(module, '_x', 1)"):
        assert SETS_A_PRIVATE_NAME.search(line)
    setting = {}
    for file in TESTS.rglob("*.py"):
        found = SETS_A_PRIVATE_NAME.search(file.read_text(encoding="utf-8"))
        if found and file != Path(__file__):
            setting[file.relative_to(TESTS).as_posix()] = found[0]
    assert setting == {}
