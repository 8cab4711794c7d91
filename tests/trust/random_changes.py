"""Small mistakes that can be made in a file, one at a time: `sabotage` makes them."""

from __future__ import annotations

import ast
from collections import Counter
from pathlib import Path
from typing import Any

from harmless_changes import SAME_RESULT, SPEED_ALONE, SPEED_ALONE_EVERYWHERE

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


def is_marked(function: ast.FunctionDef, decorator: str) -> bool:
    """Tell whether a function has a decorator, such as `compiled`."""
    return any(decorator in ast.unparse(one) for one in function.decorator_list)


class _Saboteur(ast.NodeTransformer):
    """Visits the places where something can be changed; changes the one of a number."""

    def __init__(self, name: str, lines: list[str], target: int) -> None:
        self.count = self.n_passed_over = 0
        self.line, self.what = 0, ""
        self._target = target
        self._passed_over = {**SPEED_ALONE_EVERYWHERE, **SPEED_ALONE.get(name, {})}
        self._same_result = SAME_RESULT.get(name, {})
        self._lines = lines
        # By lines and changes: how many places there are.
        self.met: Counter[tuple[str, str]] = Counter()
        self._compiled = False
        # By tests of choices around: the branch.
        self._taken: dict[str, int] = {}

    def _here(self, node: ast.expr | ast.stmt, what: str) -> bool:
        line = self._lines[node.lineno - 1].strip()
        self.met[line, what] += 1
        if {what, f"{what} #{self.met[line, what]}"} & set(self._same_result.get(line, {})):
            self.n_passed_over += 1
            return False
        self.count += 1
        if self.count - 1 != self._target:
            return False
        self.line, self.what = node.lineno, what
        return True

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        self.generic_visit(node)
        other = _OPERATORS.get(type(node.op))
        # Zeros are added to broadcast; taken away they do the same.
        if ast.unparse(node.right).startswith(("np.zeros", "zeros")):
            return node
        if other and self._here(node, f"{type(node.op).__name__} to {other.__name__}"):
            node.op = other()
        return node

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST:
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
        elif isinstance(node.value, int | float) and self._here(node, f"{node.value!r} changed"):
            node.value = node.value + 1 if isinstance(node.value, int) else 1.1 * node.value + 0.01
        return node

    # What is said of types and to readers is no behaviour.

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST:
        if node.value is not None and not self._is_passed_over(node.target):
            node.value = self.visit(node.value)
        return node

    def visit_arguments(self, node: ast.arguments) -> ast.AST:
        named = [*node.posonlyargs, *node.args]
        first = len(named) - len(node.defaults)
        node.defaults = self._visit_defaults(named[first:], node.defaults)
        node.kw_defaults = self._visit_defaults(node.kwonlyargs, node.kw_defaults)
        return node

    def _visit_defaults(self, named: list[ast.arg], defaults: list[Any]) -> list[Any]:
        return [
            value if value is None or argument.arg in self._passed_over else self.visit(value)
            for argument, value in zip(named, defaults, strict=True)
        ]

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        # Decorators say how code is compiled and kept. Nobody calls what is abstract.
        if node.name not in self._passed_over and not is_marked(node, "abstractmethod"):
            around, self._compiled = self._compiled, is_marked(node, "compiled")
            node.args = self.visit(node.args)
            node.body = [self.visit(statement) for statement in node.body]
            self._compiled = around
        return node

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.AST:
        # Nor is it behaviour that a record is frozen.
        node.body = [self.visit(statement) for statement in node.body]
        return node

    def visit_IfExp(self, node: ast.IfExp) -> ast.AST:
        branches = {ast.unparse(node.body), ast.unparse(node.orelse)}
        if isinstance(node.test, ast.Compare) and branches == {
            ast.unparse(side) for side in (node.test.left, *node.test.comparators)
        }:
            # The lesser or the greater of two: where they are equal, either is.
            self.generic_visit(node.test)
            node.body, node.orelse = self.visit(node.body), self.visit(node.orelse)
            return node
        return self.generic_visit(node)

    def visit_If(self, node: ast.If) -> ast.AST:
        return node if ast.unparse(node.test) == "TYPE_CHECKING" else self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        called = ast.unparse(node.func)
        if called == "zip":
            # What strict= refuses does not occur.
            node.args = [self.visit(argument) for argument in node.args]
        elif called.endswith(".reshape"):
            # Any number below 0 stands for what is left.
            node.func = self.visit(node.func)
            node.args = [self._visit_size(argument) for argument in node.args]
        elif self._compiled and called.endswith(".empty"):
            # Room for intermediate results: more does no harm.
            pass
        elif called.endswith("np.where") and len(node.args) == 3:
            self._visit_choice(node)
        elif called != "warnings.warn":
            self.generic_visit(node)
        return node

    def _visit_choice(self, node: ast.Call) -> None:
        """Visit a choice by `where`, but not what a choice around it by the same test passes by."""
        test = ast.unparse(node.args[0])
        taken = self._taken.get(test)
        node.args[0] = self.visit(node.args[0])
        for branch in (1, 2):
            if taken in (None, branch):
                self._taken[test] = branch
                node.args[branch] = self.visit(node.args[branch])
        if taken is None:
            del self._taken[test]

    def _visit_size(self, node: ast.expr) -> ast.expr:
        if isinstance(node, ast.Tuple):
            node.elts = [self._visit_size(size) for size in node.elts]
            return node
        return node if ast.unparse(node) == "-1" else self.visit(node)

    def visit_Raise(self, node: ast.Raise) -> ast.AST:
        return node

    def visit_JoinedStr(self, node: ast.JoinedStr) -> ast.AST:
        return node

    def visit_ImportFrom(self, node: ast.ImportFrom) -> ast.AST:
        return node

    # What sets the speed alone.

    def visit_Assign(self, node: ast.Assign) -> ast.AST:
        return node if self._is_passed_over(node.targets[0]) else self.generic_visit(node)

    def visit_keyword(self, node: ast.keyword) -> ast.AST:
        return node if node.arg in self._passed_over else self.generic_visit(node)

    def _is_passed_over(self, target: ast.expr) -> bool:
        return isinstance(target, ast.Name) and target.id in self._passed_over


def changed_at(file: Path, target: int = -1) -> tuple[_Saboteur, str]:
    """Change a place of a file; return the saboteur and the changed text."""
    text = file.read_text(encoding="utf-8")
    saboteur = _Saboteur(f"{file.parent.name}/{file.name}", text.splitlines(), target)
    tree = saboteur.visit(ast.parse(text))
    return saboteur, ast.unparse(ast.fix_missing_locations(tree))


def places_in(room: Path, names: list[str]) -> tuple[list[tuple[Path, int]], int]:
    """Return every place that can be changed in the files of these names, or of the whole room.

    And how many others `SAME_RESULT` lists.
    """
    files = sorted(file for file in room.glob("*.py") if not names or file.name in names)
    visited = [(file, changed_at(file)[0]) for file in files]
    places = [(file, number) for file, found in visited for number in range(found.count)]
    return places, sum(found.n_passed_over for _, found in visited)


def lost(package: Path) -> list[str]:
    """Return what the tables of changes that do no harm list, and the package does not have."""
    found = []
    for name in sorted({*SPEED_ALONE, *SAME_RESULT}):
        if not (package / name).exists():
            found.append(name)
            continue
        nodes = list(ast.walk(ast.parse((package / name).read_text(encoding="utf-8"))))
        known = {getattr(node, field, None) for node in nodes for field in ("id", "arg", "name")}
        found += [f"{name}: {some}" for some in SPEED_ALONE.get(name, {}) if some not in known]
        met = changed_at(package / name)[0].met
        for line, changes in SAME_RESULT.get(name, {}).items():
            for change in changes:
                what, _, number = change.partition(" #")
                if met[line, what] < int(number or 1):
                    found.append(f"{name}: {change}: {line}")
    return found
