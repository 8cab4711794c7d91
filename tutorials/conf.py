"""Settings of the documentation site, which `python tutorials/build_site.py` builds."""

from latex2mathml.converter import convert

import riemhuman

project = "riemhuman"
author = copyright = "The riemhuman developers"
version = release = riemhuman.__version__

extensions = [
    "myst_nb",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "sphinx_design",
]
exclude_patterns = ["_build", "notebooks", "recordings"]

# Notebooks are stored with their outputs, which a test checks, so nothing runs here.
nb_execution_mode = "off"
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3

autosummary_generate = True
autodoc_typehints = "none"
numpydoc_show_class_members = False
toc_object_entries_show_parents = "hide"  # "dist()", where "EbinMetric.dist()" would be cut off

templates_path = ["_templates"]
html_theme = "pydata_sphinx_theme"
html_title = "riemhuman"
html_static_path = ["_static"]
html_css_files = ["viewer.css", "site.css"]
html_js_files = [("three.min.js", {"defer": "defer"}), ("viewer.js", {"defer": "defer"})]
html_show_sourcelink = False
html_copy_source = False
html_logo = "_static/logo.svg"
html_favicon = "_static/logo.svg"
html_theme_options = {
    "logo": {"text": "riemhuman", "alt_text": "riemhuman, home page"},
    "header_links_before_dropdown": 6,
    "navbar_persistent": [],
    "navbar_end": ["search-button", "theme-switcher"],
    "show_prev_next": True,
}
# These pages have no pages below them to list in a sidebar.
html_sidebars: dict[str, list[str]] = {page: [] for page in ("index", "install", "search")}
html_math_renderer = "mathml"


def setup(app):
    """Draw formulas as MathML, which browsers show without a script; make defaults readable."""
    app.connect("autodoc-process-signature", _readable_defaults)
    app.add_html_math_renderer(
        "mathml",
        inline_renderers=(lambda self, node: _write(self, node, "inline"), None),
        block_renderers=(lambda self, node: _write(self, node, "block"), None),
    )


def _readable_defaults(app, what, name, value, options, signature, returned):
    """Show dots for a default that a data class creates for each instance."""
    return (signature and signature.replace("<factory>", "..."), returned)


def _write(translator, node, display):
    from docutils.nodes import SkipNode

    formula = convert(node.astext(), display=display)
    if display == "block":
        formula = f'<div class="formula">{formula}</div>'
    translator.body.append(formula)
    raise SkipNode
