"""Imports are seen by checkers: `lint-imports` holds them to the contracts of setup.cfg."""

import ast
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "riemhuman"


def imports_by_text(path):
    """Return whether a file calls `import_module`."""
    text = path.read_text(encoding="utf-8")
    if "import_module" not in text:
        return False
    calls = [node.func for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Call)]
    return any("import_module" in ast.unparse(function) for function in calls)


def test_modules_are_imported_by_names_that_checkers_see():
    """Only what loads other libraries imports by a text."""
    found = {
        str(path.relative_to(PACKAGE)) for path in PACKAGE.rglob("*.py") if imports_by_text(path)
    }
    assert found <= {"__init__.py", "optional.py"}
