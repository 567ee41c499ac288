"""Pages as a browser shows them: wide, narrow, dark and printed on A4 and letter; nothing is cut off."""

import re
import shutil
import subprocess

import numpy as np
import pytest

import exactarm as ea

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")
pytestmark = [pytest.mark.slow, pytest.mark.skipif(BROWSER is None, reason="chromium is not installed")]
FLAGS = ("--no-sandbox", "--headless", "--disable-gpu", "--hide-scrollbars")


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    result = ea.calibrate("ur10", ea.example("ur10/series_B"), threads=1)
    return result.save(tmp_path_factory.mktemp("page"))


def browser(*words):
    done = subprocess.run([BROWSER, *FLAGS, *words], capture_output=True, timeout=600)
    assert done.returncode == 0, done.stderr[-500:]


def shot(page, name, width, *words):
    from PIL import Image

    path = page.parent / f"{name}.png"
    browser(f"--screenshot={path}", f"--window-size={width},3000", *words, page.as_uri())
    return np.asarray(Image.open(path).convert("L"), float)


@pytest.mark.parametrize("width", [1400, 500])
def test_the_page_fills_its_window_and_leaves_a_margin(page, width):
    picture = shot(page, f"wide_{width}", width)
    inked = np.flatnonzero((picture < 128).any(axis=0))
    assert picture.shape[1] == width and inked[0] >= 5 and inked[-1] <= width - 5
    assert (picture < 128).any(axis=1).sum() > 800  # rows with something on them


def test_the_page_is_dark_where_that_is_asked_for(page):
    light, dark = shot(page, "light", 1000), shot(page, "dark", 1000,
                                                  "--blink-settings=preferredColorScheme=0")
    assert np.median(light) > 240 and np.median(dark) < 60


@pytest.mark.parametrize("paper, width, height", [("A4", 595, 842), ("letter", 612, 792)])
def test_a_printed_page_loses_no_column(page, paper, width, height):
    if shutil.which("pdftotext") is None:
        pytest.skip("pdftotext is not installed")
    sheet = page.with_name(f"{paper}.html")
    style = f"<style>@page {{ size: {paper}; margin: 12mm }}</style>"
    text = page.read_text().replace("</head>", style + "</head>")
    read = re.search(r"<dt>files</dt><dd>.*?</dd>", text, re.DOTALL).group()
    longer = [read.replace("<dd>", "<dd>" + "x" * length) for length in range(0, 120, 3)]
    sheet.write_text(text.replace(read, "".join(longer)))  # wherever the line of a path happens to end
    pdf = page.with_name(f"{paper}.pdf")
    browser("--no-pdf-header-footer", f"--print-to-pdf={pdf}", sheet.as_uri())
    boxes = subprocess.run(["pdftotext", "-bbox", str(pdf), "-"], capture_output=True, text=True).stdout
    size = [float(x) for x in re.search(r'page width="([\d.]+)" height="([\d.]+)"', boxes).groups()]
    assert np.allclose(size, (width, height), atol=2.0)  # points
    right = [float(x) for x in re.findall(r'xMax="([\d.]+)"', boxes)]
    assert len(right) > 200 and max(right) < width - 20
    words = re.findall(r">([^<]+)</word>", boxes)
    # last columns of the tables, and the footer
    assert {"declared", "identified", "maximum"} <= set(words)
    assert words.count("SHA-256") == len(longer)
