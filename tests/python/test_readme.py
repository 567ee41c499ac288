"""The program in the README runs as it is printed."""

import re
from pathlib import Path

README = Path(__file__).parents[2] / "README.md"


def test_the_python_of_the_readme_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    programs = re.findall(r"```python\n(.*?)```", README.read_text(), flags=re.DOTALL)
    assert programs
    for program in programs:
        exec(compile(program, str(README), "exec"), {})
    assert re.fullmatch(r"0\.3\d mm on poses that were never fitted\n", capsys.readouterr().out)
    assert (tmp_path / "ur10_calibrated.toml").read_text().startswith("# Robot file")
