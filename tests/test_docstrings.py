"""Public names have a numpydoc docstring whose parameters are those of the signature."""

import dataclasses
import enum
import functools
import importlib
import inspect
import pkgutil

from numpydoc.docscrape import NumpyDocString
from public_names import public_objects

import riemhuman

MODULES = ["riemhuman"] + [
    module.name for module in pkgutil.walk_packages(riemhuman.__path__, "riemhuman.")
]
PUBLIC = {
    name: value
    for name, value in public_objects().items()
    if inspect.isclass(value) or inspect.isroutine(value)
}


def problems_of(label, value):
    """Return the faults in the docstrings of a public class or function."""
    if not inspect.isclass(value):
        return problems_of_function(label, value)
    problems = problems_of_summary(label, vars(value).get("__doc__"))
    if problems:
        return problems
    if signature_names(value):
        # The fields of a data class may be documented as the attributes they are.
        is_record = dataclasses.is_dataclass(value) or issubclass(value, tuple)
        sections = ["Parameters", "Attributes"] if is_record else ["Parameters"]
        problems = problems_of_parameters(label, value, vars(value)["__doc__"], sections)
    for name, member in vars(value).items():
        if not name.startswith("_"):
            problems += problems_of_member(f"{label}.{name}", value, name, member)
    return problems


def problems_of_member(label, owner, name, member):
    """Return the faults of a method or property; an override may leave out what it inherits."""
    if isinstance(member, (classmethod, staticmethod)):
        member = member.__func__
    bases = owner.__mro__[1:]
    inherited = any(getattr(vars(base).get(name), "__doc__", None) for base in bases)
    if isinstance(member, (property, functools.cached_property)):
        return [] if inherited else problems_of_summary(label, member.__doc__)
    member = undecorated(member)
    if not inspect.isfunction(member):
        return []
    if not inherited:
        return problems_of_function(label, member)
    if member.__doc__ is None:
        return []
    problems = problems_of_summary(label, member.__doc__)
    if "Parameters\n" in member.__doc__:
        problems += problems_of_parameters(label, member, member.__doc__, ["Parameters"])
    return problems


def problems_of_function(label, function):
    problems = problems_of_summary(label, function.__doc__)
    return problems or problems_of_parameters(label, function, function.__doc__, ["Parameters"])


def problems_of_summary(label, doc):
    if not (doc or "").strip():
        return [f"{label} has no docstring"]
    summary = inspect.cleandoc(doc).split("\n\n")[0]
    if "\n" in summary or not summary.endswith("."):
        return [f"{label}: the docstring must begin with one line that ends with a full stop"]
    return []


def problems_of_parameters(label, function, doc, sections):
    expected = signature_names(function)
    parsed = NumpyDocString(inspect.cleandoc(doc))
    listed = [
        [name.strip() for entry in parsed[section] for name in entry.name.split(",")]
        for section in sections
    ]
    if expected in listed:
        return []
    return [f"{label}: {sections[0]} are {listed[0]}, the signature says {expected}"]


def signature_names(function):
    """Return the names of the parameters, as numpydoc writes them, without self and cls."""
    prefixes = {inspect.Parameter.VAR_POSITIONAL: "*", inspect.Parameter.VAR_KEYWORD: "**"}
    try:
        parameters = inspect.signature(undecorated(function)).parameters
    except ValueError:  # a class of C, such as an enumeration or an exception
        return []
    names = [prefixes.get(value.kind, "") + name for name, value in parameters.items()]
    is_inherited = inspect.isclass(function) and (
        function.__init__ is object.__init__ or issubclass(function, enum.Enum)
    )
    if is_inherited or names == ["*args", "**kwargs"]:
        return []
    return names[1:] if names[:1] in (["self"], ["cls"]) else names


def undecorated(member):
    """Return the function as it is written, without its decorators."""
    if getattr(member, "_is_autograd_primitive", False):
        return inspect.getclosurevars(member).nonlocals["f_raw"]
    member = getattr(member, "py_func", member)
    return inspect.unwrap(member) if callable(member) and not inspect.isclass(member) else member


def test_public_names_are_documented():
    assert [fault for name, value in PUBLIC.items() for fault in problems_of(name, value)] == []


def test_modules_say_what_they_hold():
    docs = {name: importlib.import_module(name).__doc__ for name in MODULES}
    assert [fault for name, doc in docs.items() for fault in problems_of_summary(name, doc)] == []
