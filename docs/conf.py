"""How the site is built: `make docs`. Nothing is fetched, neither to build it nor to read it."""

import sys
import tomllib
from pathlib import Path

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS / "extensions"))
_about = tomllib.loads((DOCS.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]

project = "gtval"
author = "The gtval authors"
project_copyright = "The gtval authors"
release = version = _about["version"]
html_title = f"gtval {release}"

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "formulas",
    "rooms",
]
root_doc = "index"
source_suffix = {".md": "markdown"}
exclude_patterns = ["extensions", "_static", "**/*.py"]

html_theme = "furo"
html_static_path = ["_static"]
html_css_files = ["gtval.css"]
html_copy_source = False
html_show_sphinx = False
html_theme_options = {"navigation_with_keys": False}

# Links to headings as GitHub makes them, so that the same text works in both places.
myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "fieldlist"]

# Signatures without types: the docstrings give types with shapes and units.
autodoc_typehints = "none"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}
autosummary_generate = False
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False

nitpicky = True
# Bases and defaults that belong to other libraries: their pages are not fetched.
nitpick_ignore_regex = [(r"py:.*", r"(?!gtval|validation|survey|laser_gt|vision_gt|rtk_gt).*")]
suppress_warnings = ["myst.xref_missing_outside"]
