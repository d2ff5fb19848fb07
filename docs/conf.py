"""Settings of the documentation site, and the part of it that the program writes: ``make site``."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

from reference import write_reference  # noqa: E402 - found beside this file

project = "thermofast"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
html_theme = "furo"
html_title = "thermofast"
html_static_path: list[str] = []
exclude_patterns = ["notebook.ipynb"]
myst_heading_anchors = 3
# Files of the repository that are no pages are named in the text, and links to them lead nowhere here.
suppress_warnings = ["myst.xref_missing", "misc.highlighting_failure"]
autodoc_typehints = "signature"
autodoc_default_options = {"members": True}

write_reference(HERE / "generated")
