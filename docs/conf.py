"""How the documentation is built: `make docs`. Warnings are errors there, and nothing is fetched from anywhere."""

import sys
from pathlib import Path

import pyramap

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_ext"))

project = "pyramap"
author = "the authors of pyramap"
copyright = f"2026, {author}"
version = release = pyramap.__version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "myst_nb",
    # Our own, in _ext:
    "docstrings",
    "made_at_build",
    "mathml",
    "source_names",
]
exclude_patterns = ["images", "generated/shell.md"]
nitpicky = True

html_math_renderer = "mathml"
html_theme = "furo"
html_static_path = ["_static"]
html_css_files = ["equations.css"]
html_title = f"pyramap {version}"
html_copy_source = False
maximum_signature_line_length = 100
add_module_names = False
# Quotes in docstrings are Python's: values are to be copied as they stand.
smartquotes = False

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3

# The notebook is run in every build, and an error in it is an error of the build.
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300

autodoc_member_order = "bysource"
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False

# Docstrings have single backticks around code. What names a thing of ours becomes a link, the rest stays code.
default_role = "py:obj"
nitpick_ignore_regex = [
    ("py:obj", r".*"),
    # Types of other packages: their inventories would have to be fetched.
    ("py:class", r"(np|numpy|trimesh|typing|collections|pathlib|os)\..*"),
    ("py:class", r"ArrayLike|NDArray|PathLike|Path|Literal|Self|Any|Callable|Iterable|Iterator|Mapping|Sequence"),
    # Type variables, and what stands for either kind of reference to a frame.
    ("py:class", r"(pyramap\.datasets\.)?(.*\.)?(AnyFrame|AnyRef|Ref|Item|Loaded)"),
]
