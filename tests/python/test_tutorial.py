"""The tutorial runs word for word: its Python and its command lines, in order, in one folder; and it says
what comes out."""

import json
import re
import shlex
from pathlib import Path

from exactarm import cli

PAGE = (Path(__file__).parents[2] / "docs" / "tutorial.md").read_text()


def test_the_tutorial_runs_and_ends_where_it_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    blocks = re.findall(r"```(python|console)\n(.*?)```", PAGE, flags=re.DOTALL)
    assert [kind for kind, _ in blocks].count("console") >= 6
    for kind, block in blocks:
        if kind == "python":
            exec(compile(block, "tutorial.md", "exec"), names)
            continue
        for line in block.splitlines():
            prompt, program, *words = shlex.split(line)
            assert (prompt, program) == ("$", "exactarm")
            assert cli.main([*words, "--quiet", "--threads", "1"]) == 0, line
    result = lambda folder: json.loads((tmp_path / folder / "result.json").read_text())
    calibrated, diagnosed = result("calibrated"), result("diagnosed")
    assert 1.0e-3 < calibrated["before"]["validation"]["mean"] < 1.2e-3
    assert calibrated["after"]["validation"]["mean"] < 0.15e-3
    assert diagnosed["effects"][0]["joint"] == 3 and diagnosed["after"]["validation"]["mean"] < 0.065e-3
    fresh = [result(f"fresh_{name}")["error"]["mean"] for name in ("calibrated", "diagnosed")]
    assert fresh[1] < 0.7 * fresh[0]
    assert (tmp_path / "program" / "targets.csv").exists() and "racer" in capsys.readouterr().out
