"""Sphinx configuration; first writes the gallery and the picture of the layers into generated/."""

import os
import sys
from importlib.util import find_spec
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "extensions"))

import gallery_pages
import gallery_runs
import structure
from placing import write_changed
from sphinx.errors import ConfigError

import impactfem

project = "impactfem"
author = "The impactfem developers"
copyright = author  # noqa: A001  (the name that Sphinx reads)
version = release = impactfem.__version__

extensions = [
    "myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinxcontrib.bibtex",
    "accessible", "ages", "api_text", "mathml",
]  # fmt: skip
bibtex_bibfiles = ["references.bib"]
bibtex_default_style = "alpha"
bibtex_reference_style = "author_year"
myst_enable_extensions = ["dollarmath", "amsmath"]
myst_heading_anchors = 3
exclude_patterns = [
    "_build",
    "generated/extra",
    "limits_table.md",
]
suppress_warnings = ["config.cache"]
if find_spec("dolfinx") is None:  # the page of the interface then lacks what needs it
    suppress_warnings.append("autodoc.import_object")
nitpicky = True
# Types in signatures that have no page of their own.
nitpick_ignore_regex = [("py:.*", ".*")]

html_theme = "furo"
html_theme_options = {"top_of_page_buttons": []}
html_math_renderer = "mathml"
html_title = f"impactfem {version}"
html_static_path = ["_static"]
html_css_files = ["impactfem.css"]
html_extra_path = ["generated/extra"]

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
python_maximum_signature_line_length = 88
# Docstrings are plain text with code in single backticks.
default_role = "code"
napoleon_google_docstring = True
napoleon_numpy_docstring = False

GENERATED = Path(__file__).parent / "generated"

# The demos are run for `-t gallery` (make docs); other builds show what is stored.
folder = Path(os.environ.get("IMPACTFEM_GALLERY") or gallery_runs.DEFAULT).resolve()
runs = gallery_runs.find_runs(folder)
if tags.has("gallery"):  # noqa: F821  (defined by Sphinx)
    try:
        runs, _ = gallery_runs.execute_all(folder)
    except gallery_runs.GalleryError as fault:
        raise ConfigError(f"a demo of the gallery fails\n{fault}") from None
gallery_pages.write(runs)
write_changed(GENERATED / "structure.svg", structure.picture())
