"""Corners of a ChArUco board in a picture, found by OpenCV (optional: `pip install exactarm[camera]`).

    find_corners(picture, setup) -> numbers (K,), pixels (K, 2), size of the picture (width, height)

A pixel's middle has whole coordinates, from the left and from the top. Both patterns of OpenCV are tried,
that of today and that before its version 4.6.
Source: Garrido-Jurado and others, Pattern Recognition 47(6), 2014 (markers).
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np

from exactarm.data.fixture import CameraSetup
from exactarm.errors import InputError

MOST_PIXELS = 200_000_000  # of a picture: twice the largest sensor sold, and 0.2 GB


def opencv() -> ModuleType:
    """The library. Raises InputError where it is not installed."""
    os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(MOST_PIXELS))
    try:
        import cv2
    except ImportError:
        raise InputError(
            "corners in pictures need OpenCV, which is not installed; expected `pip install "
            "exactarm[camera]`, or a table of corners found elsewhere (columns picture, corner, u_px, v_px)"
        ) from None
    return cv2


def find_corners(picture: str | Path, setup: CameraSetup) -> tuple[np.ndarray, np.ndarray, tuple[int, int]]:
    """Corners by their numbers on the board; none where the board is not seen."""
    cv2 = opencv()
    with _unheard():
        image = cv2.imread(str(picture), cv2.IMREAD_GRAYSCALE) if os.path.isfile(picture) else None
    if image is None:
        raise InputError("cannot be read as a picture; expected a .png, .jpg, .bmp or .tif file of at most "
                         f"{MOST_PIXELS / 1e6:.0f} million pixels", file=str(picture))
    best = np.zeros(0, int), np.zeros((0, 2))
    for legacy in (False, True):
        corners, numbers, _, _ = cv2.aruco.CharucoDetector(_board(cv2, setup, legacy)).detectBoard(image)
        if numbers is not None and len(numbers) > len(best[0]):
            best = numbers.ravel().astype(int), corners.reshape(-1, 2).astype(float)
    return *best, (image.shape[1], image.shape[0])


@contextlib.contextmanager
def _unheard() -> Iterator[None]:
    """What libpng and OpenCV write to the process' stderr beside the one line of a refusal goes nowhere."""
    try:
        before, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    except OSError:  # no stderr, or no descriptor left
        yield
        return
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(before, 2)
        os.close(before)
        os.close(nowhere)


def _board(cv2: ModuleType, setup: CameraSetup, legacy: bool):
    known = getattr(cv2.aruco, setup.dictionary, None) if setup.dictionary.startswith("DICT_") else None
    if known is None or setup.marker is None:
        raise InputError("[board] in the fixture file: expected marker_mm and dictionary of a ChArUco board, "
                         f'as "DICT_5X5_100"; found {setup.dictionary or "none"}')
    if setup.marker >= setup.square:
        raise InputError(f"[board] in the fixture file: marker_mm {1e3 * setup.marker:g} is not below "
                         f"square_mm {1e3 * setup.square:g}; expected a marker inside its square")
    markers = cv2.aruco.getPredefinedDictionary(known)
    most = setup.columns * setup.rows // 2
    if len(markers.bytesList) < most:
        raise InputError(f"{setup.dictionary} has {len(markers.bytesList)} markers; expected {most} for "
                         f"{setup.columns} by {setup.rows} squares")
    board = cv2.aruco.CharucoBoard((setup.columns, setup.rows), setup.square, setup.marker, markers)
    board.setLegacyPattern(legacy)
    return board
