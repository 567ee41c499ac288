"""Accepted drafts: the user's own library of effects, a folder of TOML files, each with one entry
[[effects]].

The folder is that of the environment variable EXACTARM_EFFECTS, or `exactarm/effects` in the user's
configuration folder.
"""

import os
import tomllib
from pathlib import Path


def effects_folder() -> Path:
    own = os.environ.get("EXACTARM_EFFECTS")
    if own:
        return Path(own)
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "exactarm" / "effects"


def accepted_drafts() -> list[dict]:
    """The entries of all files, by name; a file that cannot be read raises as TOML does."""
    folder = effects_folder()
    if not os.path.isdir(folder):
        return []
    found = []
    for path in sorted(folder.glob("*.toml")):
        found += tomllib.loads(path.read_text(encoding="utf-8")).get("effects", [])
    return found
