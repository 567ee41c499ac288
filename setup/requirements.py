"""Prints requirements named in pyproject.toml, one a line: `build` or the name of an extra such as `test`."""

import sys
import tomllib
from pathlib import Path

project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())
for name in sys.argv[1:]:
    wanted = (
        project["build-system"]["requires"]
        if name == "build" else project["project"]["optional-dependencies"][name]
    )
    print("\n".join(wanted))
