"""docs/effects.md says what the library is, and its effects have what a reader of the page needs."""

import re
import runpy
from pathlib import Path

import pytest

from exactarm.effects import library

DOCS = Path(__file__).parents[2] / "docs"
WRITER = runpy.run_path(str(DOCS / "write_effects.py"))


def test_the_page_is_what_the_library_says():
    assert (DOCS / "effects.md").read_text() == WRITER["page"](), "run: python docs/write_effects.py"


@pytest.mark.parametrize("name", [name for name, cls in library().items() if not cls.declared])
def test_every_cause_names_source_kinds_and_units(name):
    cls = library()[name]
    assert cls.kinds and cls.source
    assert WRITER["parameters"](cls) or "open_parameters" in vars(cls)


def test_links_between_pages_lead_somewhere():
    for path in [*DOCS.glob("*.md"), DOCS.parent / "README.md"]:
        for target in re.findall(r"\]\(([^)#:]+)\)", path.read_text()):
            assert (path.parent / target).exists(), f"{path.name}: {target}"
