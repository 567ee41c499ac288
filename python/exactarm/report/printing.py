"""A page of a report as PDF, printed by a browser that is there (chromium, chrome), without anything fetched.

Returns why it was not printed, "" where it was: a certificate is complete as HTML, so a missing browser is no
failure.
"""

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
PATIENCE_S = 120.0  # a page takes two seconds on an idle core
_FLAGS = ("--headless", "--disable-gpu", "--no-pdf-header-footer", "--no-first-run", "--disable-extensions")


def print_page(page: Path, pdf: Path) -> str:
    """Prints `page` (HTML) into `pdf`."""
    browser = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if browser is None:
        return f"no browser to print with is installed (expected one of {', '.join(BROWSERS[:3])})"
    # a browser of root's refuses its sandbox
    root = ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []
    with tempfile.TemporaryDirectory() as profile:
        words = [browser, *_FLAGS, *root, f"--user-data-dir={profile}", f"--print-to-pdf={pdf.resolve()}",
                 page.resolve().as_uri()]
        try:
            done = subprocess.run(words, capture_output=True, timeout=PATIENCE_S)
        except (OSError, subprocess.TimeoutExpired) as error:
            pdf.unlink(missing_ok=True)
            return f"{Path(browser).name} did not print it ({type(error).__name__})"
    if done.returncode or not pdf.is_file() or not pdf.read_bytes().startswith(b"%PDF"):
        pdf.unlink(missing_ok=True)
        return f"{Path(browser).name} did not print it (exit {done.returncode})"
    return ""
