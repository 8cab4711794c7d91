"""Seeded sabotage: how many small mistakes in a room do its own tests notice?

``python tests/trust/sabotage.py --room kernels --n 40 --seed 0`` changes one operator, constant,
comparison or condition at a time in a copy of the package, runs the tests of that room until one
fails, and prints the share of changes that were noticed, and those that were not.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
_OPERATORS = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Pow: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.MatMult: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
}
_COMPARISONS = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}


class _Saboteur(ast.NodeTransformer):
    """Visits the places where something can be changed; changes the one of a number."""

    def __init__(self, target: int = -1) -> None:
        self.count = 0
        self.what = ""
        self._target = target

    def _here(self, node: ast.expr, what: str) -> bool:
        self.count += 1
        if self.count - 1 != self._target:
            return False
        self.what = f"line {node.lineno}: {what} in `{ast.unparse(node)[:70]}`"
        return True

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        self.generic_visit(node)
        other = _OPERATORS.get(type(node.op))
        if other and self._here(node, f"{type(node.op).__name__} to {other.__name__}"):
            node.op = other()
        return node

    def visit_Compare(self, node: ast.Compare) -> ast.AST:
        self.generic_visit(node)
        other = _COMPARISONS.get(type(node.ops[0]))
        if other and self._here(node, f"{type(node.ops[0]).__name__} to {other.__name__}"):
            node.ops[0] = other()
        return node

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.AST:
        self.generic_visit(node)
        if isinstance(node.op, ast.USub | ast.Not) and self._here(node, "sign or `not` dropped"):
            return node.operand
        return node

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.AST:
        self.generic_visit(node)
        if self._here(node, "`and` and `or` exchanged"):
            node.op = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        return node

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        if isinstance(node.value, bool):
            if self._here(node, "truth flipped"):
                node.value = not node.value
        elif isinstance(node.value, int | float) and self._here(node, "number changed"):
            node.value = node.value + 1 if isinstance(node.value, int) else 1.1 * node.value + 0.01
        return node

    # What is said of types and to readers is no behaviour.

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST:
        if node.value is not None:
            node.value = self.visit(node.value)
        return node

    def visit_arguments(self, node: ast.arguments) -> ast.AST:
        node.defaults = [self.visit(value) for value in node.defaults]
        return node

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        node.args = self.visit(node.args)
        node.body = [self.visit(statement) for statement in node.body]
        return node

    def visit_Raise(self, node: ast.Raise) -> ast.AST:
        return node

    def visit_JoinedStr(self, node: ast.JoinedStr) -> ast.AST:
        return node

    def visit_ImportFrom(self, node: ast.ImportFrom) -> ast.AST:
        return node


def mutants(room: Path) -> list[tuple[Path, int]]:
    """Return every place in the files of a room that can be changed."""
    places = []
    for file in sorted(room.glob("*.py")):
        saboteur = _Saboteur()
        saboteur.visit(ast.parse(file.read_text(encoding="utf-8")))
        places += [(file, number) for number in range(saboteur.count)]
    return places


def run_tests(copy: Path, room: str, seconds: float) -> str:
    """Return "survived", "killed" or "timed out"."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
    environment = os.environ | {
        "NUMBA_CACHE_DIR": str(copy / "numba"),
        "PYTHONDONTWRITEBYTECODE": "1",
        "PYTHONPATH": str(copy),
    }
    try:
        done = subprocess.run(
            [*command, f"tests/{room}"],
            cwd=copy,
            env=environment,
            capture_output=True,
            timeout=seconds,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return "timed out"
    return "survived" if done.returncode == 0 else "killed"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--room", default="kernels")
    parser.add_argument("--n", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--timeout", type=float, default=300.0, help="seconds for one change")
    options = parser.parse_args()
    places = mutants(ROOT / "riemhuman" / options.room)
    chosen = random.Random(options.seed).sample(places, min(options.n, len(places)))
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        ignored = shutil.ignore_patterns("__pycache__")
        for name in ("riemhuman", "tests"):
            shutil.copytree(ROOT / name, copy / name, ignore=ignored)
        shutil.copy(ROOT / "setup.cfg", copy)
        if run_tests(copy, options.room, 4 * options.timeout) != "survived":
            sys.exit("the tests of the room fail without any change")
        noticed = 0
        for number, (file, target) in enumerate(chosen, start=1):
            source = file.read_text(encoding="utf-8")
            saboteur = _Saboteur(target)
            changed = ast.unparse(ast.fix_missing_locations(saboteur.visit(ast.parse(source))))
            place = copy / file.relative_to(ROOT)
            place.write_text(changed, encoding="utf-8")
            began = time.monotonic()
            end = run_tests(copy, options.room, options.timeout)
            place.write_text(source, encoding="utf-8")
            noticed += end != "survived"
            seconds = time.monotonic() - began
            line = f"{number:3} {end:9} {seconds:5.0f} s  {file.name} {saboteur.what}"
            sys.stdout.write(line + "\n")
            sys.stdout.flush()
    share = 100 * noticed / len(chosen)
    sys.stdout.write(f"{noticed} of {len(chosen)} noticed, {share:.0f} % ({len(places)} places)\n")


if __name__ == "__main__":
    main()
