"""Settings of Sphinx for the documentation site (``make site``)."""

from __future__ import annotations

import linkage_atlas

project = "linkage-atlas"
version = release = linkage_atlas.__version__
extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_gallery.gen_gallery",
]
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


def write_command_line(app: object) -> None:
    """Write the help of every command to ``generated/command_line.md``."""
    from argparse import _SubParsersAction
    from pathlib import Path

    from app.cli import make_parser

    parser = make_parser(all_commands=True)
    commands = next(action for action in parser._actions if isinstance(action, _SubParsersAction))
    sections = [f"```text\n{parser.format_help()}```\n"]
    for name, command in commands.choices.items():
        sections.append(f"## {name}\n\n```text\n{command.format_help()}```\n")
    folder = Path(__file__).parent / "generated"
    folder.mkdir(exist_ok=True)
    (folder / "command_line.md").write_text("\n".join(sections))


def link_to_contributing(app: object, name: str, content: list[str]) -> None:
    """Lead links to ``CONTRIBUTING.md``, which lies outside of the documentation, to the page that includes it."""
    content[0] = content[0].replace("(../CONTRIBUTING.md", "(/background/contributing.md")


def setup(app: object) -> None:
    """Register the generated page of the command line, and links out of the documentation."""
    app.connect("builder-inited", write_command_line)  # type: ignore[attr-defined]
    app.connect("source-read", link_to_contributing)  # type: ignore[attr-defined]
