"""Settings of Sphinx for the documentation site (``make site``)."""

from __future__ import annotations

import linkage_atlas
from docs.generated_pages import write_pages

project = "linkage-atlas"
version = release = linkage_atlas.__version__
extensions = ["myst_parser", "numpydoc", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx_gallery.gen_gallery"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["_build", "generated", "examples/*", "*.ipynb", "_templates"]
html_theme = "pydata_sphinx_theme"
html_title = "linkage-atlas"
html_show_sourcelink = False
html_theme_options = {"show_nav_level": 2, "navigation_with_keys": False, "secondary_sidebar_items": ["page-toc"]}

myst_heading_anchors = 3
myst_enable_extensions = ["colon_fence", "dollarmath"]

templates_path = ["_templates"]
autosummary_generate = True
autodoc_typehints = "none"
autodoc_member_order = "bysource"
numpydoc_show_class_members = False

sphinx_gallery_conf = {
    "examples_dirs": "examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"/ex\d+",
    "within_subsection_order": "FileNameSortKey",
    "download_all_examples": False,
    "show_memory": False,
    "show_signature": False,
    "remove_config_comments": True,
    "abort_on_example_error": True,
}


def link_to_contributing(app: object, name: str, content: list[str]) -> None:
    """Lead links to ``CONTRIBUTING.md``, which lies outside of the documentation, to the page that includes it."""
    content[0] = content[0].replace("(../CONTRIBUTING.md", "(/background/contributing.md")


def setup(app: object) -> None:
    """Register the generated pages, and links out of the documentation."""
    app.connect("builder-inited", write_pages)  # type: ignore[attr-defined]
    app.connect("source-read", link_to_contributing)  # type: ignore[attr-defined]
