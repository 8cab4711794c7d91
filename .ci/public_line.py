"""A contract of import-linter: private modules are imported by their own subpackage alone."""

from fnmatch import fnmatch

from importlinter import Contract, ContractCheck, fields, output


class PublicLine(Contract):
    """No module imports `riemhuman.a._b` from outside `riemhuman.a`, but for the imports listed."""

    type_name = "public_line"
    shared = fields.SetField(subfield=fields.StringField(), required=False)

    def check(self, graph, verbose):
        allowed = [line.split(" -> ") for line in self.shared or ()]
        crossings, used = set(), set()
        for imported in graph.modules:
            package, _, private = imported.partition("._")
            if not private:
                continue
            for importer in graph.find_modules_that_directly_import(imported):
                if importer == package or importer.startswith(f"{package}."):
                    continue
                rules = {
                    (above, below)
                    for above, below in allowed
                    if imported == below and fnmatch(importer, above)
                }
                used |= rules
                if not rules:
                    crossings.add((importer, imported))
        unused = {(above, below) for above, below in allowed} - used
        return ContractCheck(
            kept=not crossings and not unused, metadata={"crossings": crossings, "unused": unused}
        )

    def render_broken_contract(self, check):
        for importer, imported in sorted(check.metadata["crossings"]):
            output.print_error(f"{importer} imports {imported}, which is private")
        for importer, imported in sorted(check.metadata["unused"]):
            output.print_error(f"{importer} -> {imported} is allowed, but not imported")
