"""Solvers ask properties what a metric or a space can do, and never look for names."""

import ast
from pathlib import Path

import riemhuman

SOLVERS = Path(riemhuman.__file__).parent / "solvers"
_PROBED = {"metric", "space", "target_metric"}


def probes(source):
    """Return the lines where `hasattr` or `getattr` looks at a metric or a space."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("hasattr", "getattr"):
            names = {getattr(part, "id", "") for part in ast.walk(node.args[0])}
            names |= {getattr(part, "attr", "") for part in ast.walk(node.args[0])}
            if any(name in _PROBED or name.endswith("_metric") for name in names):
                found.append(node.lineno)
    return found


def test_no_solver_probes_a_metric_or_a_space():
    files = sorted(SOLVERS.glob("*.py"))
    assert len(files) > 10
    assert {file.name: probes(file.read_text(encoding="utf-8")) for file in files} == {
        file.name: [] for file in files
    }
