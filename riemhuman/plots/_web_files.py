"""Files of the folder ``web`` of subpackages, and templates filled with values."""

from __future__ import annotations

from functools import cache, partial
from importlib.resources import files

import jinja2
from markupsafe import Markup


@cache
def web_templates(package: str) -> jinja2.Environment:
    """Return the templates in the folder ``web`` of a subpackage."""
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(partial(web_file, package)),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
    )
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":")}
    return environment


@cache
def web_file(package: str, name: str) -> str:
    """Return a text file of the folder ``web`` of a subpackage."""
    return (files(f"riemhuman.{package}") / "web" / name).read_text(encoding="utf-8")


def fill(template: str, **values: object) -> Markup:
    """Return a template of this subpackage filled with values."""
    return Markup(web_templates("plots").get_template(template).render(**values))
