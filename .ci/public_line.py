"""A contract of import-linter: private modules are imported by their own subpackage alone."""

from fnmatch import fnmatch

from importlinter import Contract, ContractCheck, fields, output


class PublicLine(Contract):
    """No module imports `riemhuman.a._b` from outside `riemhuman.a`, but for the imports listed."""

    type_name = "public_line"
    shared = fields.SetField(subfield=fields.StringField(), required=False)

    def check(self, graph, verbose):
        allowed = {tuple(line.split(" -> ")) for line in self.shared or ()}
        wrong, used = [], set()
        for imported in sorted(graph.modules):
            package, _, private = imported.partition("._")
            importers = graph.find_modules_that_directly_import(imported) if private else ()
            for importer in sorted(importers):
                if importer == package or importer.startswith(f"{package}."):
                    continue
                rules = {(a, b) for a, b in allowed if imported == b and fnmatch(importer, a)}
                used |= rules
                if not rules:
                    wrong.append(f"{importer} imports {imported}, which is private")
        for above, below in sorted(allowed - used):
            wrong.append(f"{above} -> {below} is allowed, but not imported")
        return ContractCheck(kept=not wrong, metadata={"wrong": wrong})

    def render_broken_contract(self, check):
        for message in check.metadata["wrong"]:
            output.print_error(message)
