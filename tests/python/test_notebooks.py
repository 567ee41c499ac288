"""The notebooks run from top to bottom, and hold no output of an earlier run."""

from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[2] / "docs" / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_holds_no_outputs(path):
    nbformat = pytest.importorskip("nbformat", reason="needs the package nbformat")
    book = nbformat.read(path, as_version=4)
    nbformat.validate(book)
    assert len(NOTEBOOKS) == 3 and all(not cell.get("outputs") for cell in book.cells)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of the kernel's own libraries
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path):
    nbformat = pytest.importorskip("nbformat", reason="needs the package nbformat")
    nbclient = pytest.importorskip("nbclient", reason="needs the package nbclient")
    book = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(book, timeout=1800, kernel_name="python3").execute()
    assert any(cell.get("outputs") for cell in book.cells)
