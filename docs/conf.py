"""The documentation site: Markdown pages by MyST, the Python reference from docstrings. `make docs` builds
it."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "python"))
sys.path.insert(0, str(Path(__file__).parent))

from tutorial_script import TUTORIALS, script_of

import exactarm

project, author = "exactarm", "the exactarm developers"
copyright = f"2026, {author}"
version = release = exactarm.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.mathjax",
              "sphinx_copybutton"]
myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3
html_theme, html_title = "furo", f"exactarm {release}"
html_static_path: list[str] = []
exclude_patterns = ["_site", "style.md", "notebooks"]
scripts = Path(__file__).with_name("_scripts")  # the tutorials as files to download
scripts.mkdir(exist_ok=True)
for page in TUTORIALS:
    (scripts / f"{page}.py").write_text(script_of(Path(__file__).with_name(f"{page}.md")))
autodoc_typehints, autodoc_member_order, add_module_names = "description", "bysource", False
copybutton_prompt_text = "$ "
# links to files of the repository, tables shown as csv
suppress_warnings = ["myst.xref_missing", "misc.highlighting_failure"]
