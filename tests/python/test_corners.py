"""Corners of a ChArUco board in pictures that OpenCV has printed and a homography has turned."""

import json
import re
import sys

import numpy as np
import pytest

from exactarm.cli import main
from exactarm.data.dataset import read_dataset
from exactarm.data.fixture import CameraSetup
from exactarm.errors import InputError
from exactarm.measurement.board_detection import find_corners
from exactarm.numerics.rotation import exp
from exactarm.robot_file import load_robot

SETUP = CameraSetup(columns=7, rows=5, square=0.03, marker=0.022, dictionary="DICT_5X5_100", size=(800, 600))
PIXELS_PER_M = 4000.0
FIXTURE = ('[board]\nsquares = [7, 5]\nsquare_mm = 30\nmarker_mm = 22\ndictionary = "DICT_5X5_100"\n'
           "[camera]\nsize_px = [800, 600]\n")


def picture(path, seed: int, legacy: bool = False) -> np.ndarray:
    """Writes what a camera sees, and gives the true pixels of all corners (24, 2)."""
    cv2 = pytest.importorskip("cv2")
    random = np.random.default_rng(seed)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    board = cv2.aruco.CharucoBoard((7, 5), SETUP.square, SETUP.marker, dictionary)
    board.setLegacyPattern(legacy)
    width, height = (int(PIXELS_PER_M * SETUP.square * n) for n in (7, 5))
    flat = board.generateImage((width, height))
    turn = exp(random.uniform(-0.4, 0.4, 3))
    place = np.array([0.0, 0.0, 0.35]) - turn @ np.array([0.105, 0.075, 0.0])
    lens = np.array([[900.0, 0.0, 400.0], [0.0, 900.0, 300.0], [0.0, 0.0, 1.0]])
    to_picture = lens @ np.column_stack([turn[:, :2], place])
    # the middle of the printed board's first pixel is half a pixel inside
    printed = np.array([[1 / PIXELS_PER_M, 0, 0.5 / PIXELS_PER_M], [0, 1 / PIXELS_PER_M, 0.5 / PIXELS_PER_M],
                        [0, 0, 1]])
    seen = cv2.warpPerspective(flat, to_picture @ printed, (800, 600), flags=cv2.INTER_AREA,
                               borderValue=160)
    cv2.imwrite(str(path), cv2.GaussianBlur(seen, (5, 5), 1.0))
    corners = SETUP.square * SETUP.corner(np.arange(SETUP.corners))
    corners[:, 2] = 1.0
    pixels = corners @ to_picture.T
    return pixels[:, :2] / pixels[:, 2:]


@pytest.mark.parametrize("legacy", [False, True])
def test_corners_are_found_where_they_are(tmp_path, legacy):
    true = picture(tmp_path / "board.png", 1, legacy)
    numbers, pixels, size = find_corners(tmp_path / "board.png", SETUP)
    assert size == (800, 600) and len(numbers) >= 20
    assert np.linalg.norm(pixels - true[numbers], axis=1).max() < 0.3


def test_the_command_writes_a_table_that_calibrate_reads(tmp_path):
    for k in range(3):
        picture(tmp_path / f"view{k}.png", k)
    cv2 = pytest.importorskip("cv2")
    cv2.imwrite(str(tmp_path / "view10.png"), np.full((600, 800), 128, np.uint8))
    (tmp_path / "fixture.toml").write_text(FIXTURE)
    header = ",".join(f"q_{i}_rad" for i in range(1, 7))
    rows = "\n".join(f"0.{k},-1,1,0,0.5,{k}" for k in range(4))
    (tmp_path / "joints.csv").write_text(f"{header}\n{rows}\n")
    files = [str(tmp_path / f"view{k}.png") for k in (10, 2, 0, 1)]
    words = ["corners", "ur10", str(tmp_path / "joints.csv"), *files, "--quiet"]
    assert main([*words, "--fixture", str(tmp_path / "fixture.toml"), "--out", str(tmp_path / "made")]) == 0
    made = json.loads((tmp_path / "made" / "result.json").read_text())
    assert made["pictures"] == 4 and made["without_board"] == ["view10.png"]
    data = read_dataset(tmp_path / "made" / "corners.csv", load_robot("ur10"))
    assert data.kind == "closures" and len(data) == made["corners"]
    np.testing.assert_array_equal(data.joints["q"][data.picture == 2][0], [0.2, -1, 1, 0, 0.5, 2])


@pytest.mark.parametrize(("rows", "header", "words"), [
    ("0.1\n0.2\n", "", "1 pictures, but .* has 2 rows"),
    ("0.1,other.png\n", ",file", "picture 'other.png' is not among those given"),
])
def test_rows_without_their_picture_are_refused(tmp_path, rows, header, words, capsys):
    picture(tmp_path / "view.png", 1)
    (tmp_path / "fixture.toml").write_text(FIXTURE)
    zeros = ",".join(["0"] * 5)
    names = ",".join(f"q_{i}_rad" for i in range(1, 7))
    body = "".join(f"{zeros},{row}\n" for row in rows.split())
    (tmp_path / "joints.csv").write_text(f"{names}{header}\n{body}")
    call = ["corners", "ur10", str(tmp_path / "joints.csv"), str(tmp_path / "view.png"), "--out",
            str(tmp_path / "made"), "--fixture", str(tmp_path / "fixture.toml")]
    assert main(call) == 2
    error = capsys.readouterr().err
    assert len(error.splitlines()) == 1
    assert re.search(words, error), error


def test_without_opencv_one_line_says_what_to_do(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(InputError, match=r"pip install exactarm\[camera\]"):
        find_corners(tmp_path / "board.png", SETUP)


def test_a_board_that_cannot_be_is_refused(tmp_path):
    picture(tmp_path / "board.png", 1)
    for setup, words in ((CameraSetup(), "expected marker_mm and dictionary"),
                         (CameraSetup(marker=0.03, dictionary="DICT_4X4_50"), "is not below square_mm"),
                         (CameraSetup(20, 20, marker=0.02, dictionary="DICT_4X4_50"), "has 50 markers")):
        with pytest.raises(InputError, match=words):
            find_corners(tmp_path / "board.png", setup)


def test_what_is_no_picture_is_refused_in_one_line_whatever_the_libraries_say(tmp_path, capfd):
    picture(tmp_path / "board.png", 1)
    content = bytearray((tmp_path / "board.png").read_bytes())
    content[len(content) // 2] ^= 0xFF
    (tmp_path / "board.png").write_bytes(content[: len(content) // 2 + 40])
    content[16:24] = bytes.fromhex("7fffffff7fffffff")  # width and height
    (tmp_path / "huge.png").write_bytes(content)
    for name in ("board.png", "huge.png"):
        try:
            find_corners(tmp_path / name, SETUP)
        except InputError as error:
            assert name in str(error)
    assert capfd.readouterr().err == ""
    with pytest.raises(InputError, match=r"huge.png: cannot be read as a picture"):
        find_corners(tmp_path / "huge.png", SETUP)
