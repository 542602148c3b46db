"""Settings of the documentation site; ``make docs`` builds it into build/docs."""

import sys
from pathlib import Path

from mitt.version import __version__

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_ext"))

project = "mitt"
author = "the mitt authors"
release = __version__
version = __version__
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "command_options",
    "settings_table",
]
exclude_patterns = ["figures", "_ext"]
source_suffix = {".md": "markdown"}
suppress_warnings = ["misc.highlighting_failure"]  # tables as CSV: Pygments knows no such language

myst_heading_anchors = 4  # as forges make them: the same links work in both places
myst_enable_extensions = ["colon_fence"]

autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_default_options = {"exclude-members": "__new__, __init__"}
autodoc_preserve_defaults = True
napoleon_use_rtype = False
napoleon_use_ivar = True
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 80
add_module_names = False
highlight_language = "none"

html_theme = "furo"
html_title = f"mitt {__version__}"
html_static_path = ["_static"]
html_css_files = ["mitt.css"]
html_copy_source = False
html_show_sphinx = html_show_copyright = False
html_use_index = True
