"""Public names have a numpydoc docstring whose parameters are those of the signature."""

import enum
import functools
import importlib
import inspect
import pkgutil

from numpydoc.docscrape import get_doc_object
from numpydoc.validate import Validator
from public_names import public_objects

import riemhuman

PROPERTIES = property, functools.cached_property


def public_docstrings():
    """Return what numpydoc reads of each public name, and whether it overrides another."""
    for name, value in public_objects().items():
        if inspect.isclass(value) or inspect.isroutine(value):
            yield name, read(value), False
        for member in vars(value) if inspect.isclass(value) else ():
            part = inspect.getattr_static(value, member)
            part = undecorated(getattr(part, "__func__", part))
            is_part = inspect.isfunction(part) or isinstance(part, PROPERTIES)
            if is_part and not member.startswith("_"):
                bases = value.__mro__[1:]
                overrides = any(getattr(vars(base).get(member), "__doc__", "") for base in bases)
                yield f"{name}.{member}", read(part), overrides


def read(value):
    return Validator(get_doc_object(undecorated(value), config={"show_class_members": False}))


def undecorated(value):
    """Return a function as it is written, where autograd or numba made something else of it."""
    if getattr(value, "_is_autograd_primitive", False):
        return inspect.getclosurevars(value).nonlocals["f_raw"]
    return getattr(value, "py_func", value)


def faults_of(docstring, overrides):
    """Return what is wrong with a docstring; an override may leave out what it inherits."""
    if not docstring.raw_doc.strip():
        return [] if overrides else ["no docstring"]
    if docstring.num_summary_lines > 1 or not docstring.summary.endswith("."):
        return ["must begin with one line that ends with a full stop"]
    value, listed = docstring.obj, [*docstring.doc_parameters]
    if not listed and inspect.isclass(value):
        # The fields of a data class may be documented as the attributes they are.
        listed = [*docstring._doc_parameters(["Attributes"])]
    is_kind = isinstance(value, enum.EnumMeta) or getattr(value, "_is_protocol", False)
    expected = [] if is_kind else [*docstring.signature_parameters]
    if listed == expected or (overrides and not listed):
        return []
    return [f"parameters are {listed}, the signature says {expected}"]


def test_public_names_are_documented():
    assert [
        f"{name}: {fault}"
        for name, docstring, overrides in public_docstrings()
        for fault in faults_of(docstring, overrides)
    ] == []


def test_modules_say_what_they_hold():
    modules = pkgutil.walk_packages(riemhuman.__path__, "riemhuman.")
    names = ["riemhuman", *(module.name for module in modules)]
    docs = {name: inspect.cleandoc(importlib.import_module(name).__doc__ or "") for name in names}
    assert {k: doc for k, doc in docs.items() if not doc.split("\n")[0].endswith(".")} == {}
