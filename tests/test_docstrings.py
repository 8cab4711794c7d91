"""Everything public has a numpydoc docstring whose parameters are those of its signature."""

import dataclasses
import functools
import importlib
import inspect
import pkgutil
import types

import pytest
from numpydoc.docscrape import NumpyDocString

import riemhuman
from riemhuman.docstrings import InheritsDocstrings, inherit_sections

MODULES = ["riemhuman"] + [
    module.name
    for module in pkgutil.walk_packages(riemhuman.__path__, "riemhuman.")
    if not any(part.startswith("_") for part in module.name.split("."))
]


def problems_of_module(module):
    """Return what is wrong with the docstrings of everything public that a module defines."""
    problems = problems_of_text(module.__name__, module.__doc__)
    for name, member in vars(module).items():
        member = plain_function(member)
        if name.startswith("_") or getattr(member, "__module__", None) != module.__name__:
            continue
        if inspect.isclass(member):
            problems += problems_of_class(member)
        elif inspect.isfunction(member):
            problems += problems_of_callable(f"{module.__name__}.{name}", member, member.__doc__)
    return problems


def problems_of_class(cls):
    label = f"{cls.__module__}.{cls.__name__}"
    problems = problems_of_text(label, cls.__doc__)
    if problems:
        return problems
    own_signature = any(method in vars(cls) for method in ("__init__", "__new__"))
    if own_signature and not getattr(cls, "_is_protocol", False):
        # The fields of a result may be documented as the attributes they are.
        is_record = dataclasses.is_dataclass(cls) or issubclass(cls, tuple)
        sections = ["Parameters", "Attributes"] if is_record else ["Parameters"]
        problems += problems_of_parameters(label, signature_names(cls), cls.__doc__, sections)
    for name, member in vars(cls).items():
        if name.startswith("_") and name != "__call__":
            continue
        label_of_member = f"{label}.{name}"
        if isinstance(member, (property, functools.cached_property)):
            problems += problems_of_text(label_of_member, inherited_doc(cls, name))
            continue
        if isinstance(member, (classmethod, staticmethod)):
            member = member.__func__
        member = plain_function(member)
        if inspect.isfunction(member):
            problems += problems_of_callable(label_of_member, member, inherited_doc(cls, name))
    return problems


def problems_of_callable(label, function, doc):
    return problems_of_text(label, doc) or problems_of_parameters(
        label, signature_names(function), doc, ["Parameters"]
    )


def problems_of_text(label, doc):
    if not (doc or "").strip():
        return [f"{label} has no docstring"]
    summary = inspect.cleandoc(doc).split("\n\n")[0]
    if "\n" in summary or not summary.endswith("."):
        return [f"{label}: the docstring must begin with one line that ends with a full stop"]
    return []


def problems_of_parameters(label, expected, doc, sections):
    parsed = NumpyDocString(inspect.cleandoc(doc))
    found = [
        [name.strip() for entry in parsed[section] for name in entry.name.split(",")]
        for section in sections
    ]
    if expected in found:
        return []
    return [f"{label}: {sections[0]} are {found[0]}, the signature says {expected}"]


def signature_names(function):
    """Return the names of the parameters, as numpydoc writes them, without self and cls."""
    prefixes = {inspect.Parameter.VAR_POSITIONAL: "*", inspect.Parameter.VAR_KEYWORD: "**"}
    names = [
        prefixes.get(parameter.kind, "") + name
        for name, parameter in inspect.signature(function).parameters.items()
    ]
    return names[1:] if names[:1] in (["self"], ["cls"]) else names


def inherited_doc(cls, name):
    """Return the first docstring of a member along the method resolution order."""
    documents = (vars(base)[name].__doc__ for base in cls.__mro__ if name in vars(base))
    return next(filter(None, documents), None)


def plain_function(member):
    """Return the function written in the source, out of its decorators."""
    if getattr(member, "_is_autograd_primitive", False):
        return inspect.getclosurevars(member).nonlocals["f_raw"]
    member = getattr(member, "py_func", member)
    return inspect.unwrap(member) if callable(member) and not inspect.isclass(member) else member


@pytest.mark.parametrize("name", MODULES)
def test_docstrings(name):
    problems = problems_of_module(importlib.import_module(name))
    assert not problems, "\n".join(problems)


def test_overrides_inherit_the_sections_that_they_do_not_write():
    class Base:
        def method(self, a):
            """Return something.

            At length.

            Parameters
            ----------
            a : int
                Text.

            Returns
            -------
            int

            Raises
            ------
            ValueError
                Always.
            """

        def other(self):
            """Return nothing."""

    class Derived(Base):
        size = 3

        def method(self, a):
            """Return another thing.

            Returns
            -------
            float
            """

        def other(self):
            pass

    inherit_sections(Derived)
    doc = Derived.method.__doc__
    assert doc.startswith("Return another thing.\n\nParameters\n----------\na : int\n    Text.")
    assert doc.endswith("Returns\n-------\nfloat")
    assert Derived.other.__doc__ is None
    assert "tangent_vec : array" in riemhuman.EbinMetric.exp.__doc__
    assert "met the apex" in riemhuman.EbinMetric.exp.__doc__


def test_parameters_are_inherited_one_by_one():
    class Base(InheritsDocstrings):
        """A base.

        Parameters
        ----------
        a, b : int
            Numbers.
        c : str
            Text.
        """

        def __init__(self, a, b, c):
            pass

        def method(self, x, y):
            """Return something.

            Parameters
            ----------
            x, y : float
                Numbers.
            """

    class Derived(Base):
        """Another.

        Parameters
        ----------
        b : float
            A share.

        Raises
        ------
        ValueError
            Always.
        """

        def __init__(self, c, b, a):
            pass

        def method(self, x, *y, z):
            """Return another thing.

            Parameters
            ----------
            *y
                Many.
            z : int
                A number.
            """

    @dataclasses.dataclass
    class Fields(InheritsDocstrings):
        """Fields.

        Parameters
        ----------
        a : int
            A number.
        """

        a: int

    @dataclasses.dataclass
    class More(Fields):
        """More fields.

        Parameters
        ----------
        b : int
            Another.
        """

        b: int

    class Same(Fields):
        """The same fields."""

    assert inspect.cleandoc(Derived.__doc__).split("----------\n")[1] == (
        "c : str\n    Text.\nb : float\n    A share.\na : int\n    Numbers.\n\n"
        "Raises\n------\nValueError\n    Always."
    )
    assert Derived.method.__doc__.endswith(
        "x : float\n    Numbers.\n*y\n    Many.\nz : int\n    A number."
    )
    assert More.__doc__.endswith("a : int\n    A number.\nb : int\n    Another.")
    assert Same.__doc__.endswith("a : int\n    A number.")


def module_of(source):
    """Return a module that holds only what `source` defines."""
    module = types.ModuleType("riemhuman.twin", "A module.")
    exec(source, vars(module))
    return module


GOOD = '''
class Base:
    """Summary.

    Parameters
    ----------
    a : int
        Text.
    """

    def __init__(self, a):
        self.a = a

    @property
    def size(self):
        """The size."""

    def method(self, a, *b, **c):
        """Summary.

        Parameters
        ----------
        a : int
            Text.
        *b, **c
            Text.
        """


class Derived(Base):
    """Summary."""

    def method(self, a, *b, **c):
        return a


def function(a, b=1):
    """Summary.

    Parameters
    ----------
    a, b : int
        Text.
    """


def _private(a):
    pass
'''


def test_checker_accepts_a_good_module():
    assert problems_of_module(module_of(GOOD)) == []


@pytest.mark.parametrize(
    ("written", "broken", "label"),
    [
        ("a, b : int", "b, a : int", "twin.function"),
        ("a, b : int", "a : int", "twin.function"),
        ("function(a, b=1)", "function(a, b, c)", "twin.function"),
        ("_private", "public", "twin.public"),
        ('"""The size."""', "pass", "twin.Base.size"),
        ('class Derived(Base):\n    """Summary."""', "class Derived(Base):", "twin.Derived"),
        ("def __init__(self, a)", "def __init__(self, a, b)", "twin.Base"),
        (
            "method(self, a, *b, **c):\n        return",
            "method(self, a):\n        return",
            "twin.Derived.method",
        ),
        ("*b, **c\n", "**c\n", "twin.Base.method"),
        (
            '"""Summary.\n\n        Par',
            '"""Summary\n        of two lines.\n\n        Par',
            "method",
        ),
    ],
)
def test_checker_refuses_a_broken_twin(written, broken, label):
    assert GOOD.count(written) == 1
    problems = problems_of_module(module_of(GOOD.replace(written, broken)))
    assert problems
    assert label in problems[0]


def test_checker_sees_through_decorators():
    source = """
import functools
from autograd.extend import primitive

@primitive
def traced(a):
    pass

@functools.lru_cache
def cached(a):
    pass
"""
    problems = problems_of_module(module_of(source))
    assert [problem.split()[0] for problem in problems] == [
        "riemhuman.twin.traced",
        "riemhuman.twin.cached",
    ]
