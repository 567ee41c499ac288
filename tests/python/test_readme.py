"""The README is short, its program runs as it is printed, and what it names is there."""

import re
from pathlib import Path

import pytest

from exactarm.commands.listing import find_commands

TOP = Path(__file__).parents[2]
TEXT = (TOP / "README.md").read_text()
MOST_LINES, MOST_CHARACTERS, MOST_RESULTS = 120, 120, 8


def test_the_python_of_the_readme_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    programs = re.findall(r"```python\n(.*?)```", TEXT, flags=re.DOTALL)
    assert programs
    for program in programs:
        exec(compile(program, "README.md", "exec"), {})
    assert re.search(r"^0\.38 mm on poses that were never fitted$", capsys.readouterr().out,
                     flags=re.MULTILINE)
    assert (tmp_path / "ur10_calibrated.toml").read_text().startswith("# Robot file")
    assert (tmp_path / "calibrated" / "report.html").exists()


def test_the_readme_is_short():
    lines = TEXT.splitlines()
    assert len(lines) <= MOST_LINES and max(map(len, lines)) <= MOST_CHARACTERS
    table = TEXT[TEXT.index("| command | measured |") :].partition("\n\n")[0]
    assert len(table.splitlines()) - 2 <= MOST_RESULTS


def test_every_command_is_named():
    table = TEXT[TEXT.index("| command | what it does |") :].partition("\n\n")[0]
    assert {name for name in find_commands() if f"`{name}`" not in table} == set()


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md",
                                  *sorted(f"docs/{p.name}" for p in (TOP / "docs").glob("*.md"))])
def test_links_lead_to_files(page):
    text = (TOP / page).read_text()
    for target in re.findall(r"\]\(([^)#\s]+)", re.sub(r"```.*?```", "", text, flags=re.DOTALL)):
        assert target.startswith("http") or ((TOP / page).parent / target).exists(), target


def test_every_page_is_on_the_site():
    index = (TOP / "docs" / "index.md").read_text()
    pages = {path.stem for path in (TOP / "docs").glob("*.md")} - {"index", "style"}
    assert {page for page in pages if not re.search(rf"^{page}$", index, flags=re.MULTILINE)} == set()
