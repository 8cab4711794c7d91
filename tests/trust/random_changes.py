"""Small mistakes that can be made in a file, one at a time: `sabotage` makes them."""

from __future__ import annotations

import ast
from pathlib import Path

_ROOM = "room for intermediate results: more does no harm"

# What sets how fast a right answer is found, and never which: tests must not care. Names are of
# constants, variables, functions or arguments of the file.
_SPEED_ALONE = {
    "kernels/triangles.py": {
        "_WORTH_THREADS": "from which size on threads share the work",
        "threaded": "whether threads share the work",
        **dict.fromkeys(("both", "axes", "along", "image"), _ROOM),
    },
    "kernels/turns.py": {
        "_WORTH_THREADS": "from which size on threads share the work",
        "threaded": "whether threads share the work",
        **dict.fromkeys(("axis", "before", "after", "from_axes"), _ROOM),
    },
    "kernels/tiles.py": {
        "LANES": "zeros at the end of rows, which add nothing",
        "CHUNK": "triangles summed before they join the total: rounding errors only",
        "_TILE_WORK": "work of one tile",
        "_TILES_A_THREAD": "tiles that threads share",
        "n_pairs": "pairs of one tile",
        "size": "points on the side of one tile",
    },
    "terms/sum.py": {
        "_WORTH_THREADS": "from which size on threads share the work",
        "_IN_CACHE": "triangles that terms pass over together",
        "threaded": "whether threads share the work",
        "size": "triangles that terms pass over together",
    },
    "terms/half_angle_fit.py": {"_DEGREES": "more terms than needed are no less exact"},
    "terms/term.py": {"_BLOCK": "surfaces looked at together"},
    "kernels/threads.py": {
        "N_CHUNKS": "parts that threads share",
        "_is_large": "from which size on threads share the work",
        "threaded": "whether threads share the work",
    },
    "geometry/pairwise.py": {
        "MEMORY": "features held at once",
        "_BLOCK": "points of one block",
        "_CLOSE_BLOCK": "points of one block of close pairs",
    },
    "solvers/basis_path.py": {
        "gram": "surfaces that a preconditioner is averaged over",
        "unit": "unit of the values: any does",
    },
    "solvers/disentangling.py": {
        "_LEAST_AREA": "share of their areas to which hardly any triangle shrinks",
    },
    "solvers/minimization.py": {
        "_MEMORY": "steps that the minimiser remembers",
        "_ROUND": "iterations after which a preconditioner is formed anew",
        "refresh": "when the progress bar is drawn",
    },
    "solvers/path_straightening.py": {
        "_N_NODES": "points that a preconditioner is averaged over",
        "_WALL": "height of the wall: any above the first value does",
        "nodes": "points that a preconditioner is averaged over",
        "unit": "unit of the values: any does",
    },
    "solvers/preconditioner.py": {"_RIDGE": "added to the diagonal of a preconditioner"},
    "solvers/spatial_factors.py": {
        "_LARGEST_BLOCK": "up to which size a point is one block of a preconditioner",
        "_N_PROBES": "random vectors that a preconditioner is estimated from",
        "_RIDGE": "added to the diagonal of a preconditioner",
        "_RIDGE_OF_BLOCKS": "added to the diagonal of a preconditioner",
        "one_block": "whether a point is one block of a preconditioner",
        "rng": "random vectors that a preconditioner is estimated from",
    },
    "solvers/root_finding.py": {"_MEMORY": "earlier steps that the next one is found from"},
}

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

    def __init__(self, target: int = -1, passed_over: frozenset[str] = frozenset()) -> None:
        self.count = 0
        self.line, self.what = 0, ""
        self._target = target
        self._passed_over = passed_over

    def _here(self, node: ast.expr | ast.stmt, what: str) -> bool:
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
        node.defaults = [self.visit(value) for value in node.defaults]
        node.kw_defaults = [value and self.visit(value) for value in node.kw_defaults]
        return node

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        # Decorators say how code is compiled and kept.
        if node.name not in self._passed_over:
            node.args = self.visit(node.args)
            node.body = [self.visit(statement) for statement in node.body]
        return node

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.AST:
        # Nor is it behaviour that a record is frozen.
        node.body = [self.visit(statement) for statement in node.body]
        return node

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
        elif called != "warnings.warn":
            self.generic_visit(node)
        return node

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
    passed_over = _SPEED_ALONE.get(f"{file.parent.name}/{file.name}", {})
    saboteur = _Saboteur(target, frozenset(passed_over))
    tree = saboteur.visit(ast.parse(file.read_text(encoding="utf-8")))
    return saboteur, ast.unparse(ast.fix_missing_locations(tree))


def places_in(room: Path, names: list[str]) -> list[tuple[Path, int]]:
    """Return every place that can be changed in the files of these names, or of the whole room."""
    files = sorted(file for file in room.glob("*.py") if not names or file.name in names)
    return [(file, number) for file in files for number in range(changed_at(file)[0].count)]
