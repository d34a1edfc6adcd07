"""What was rendered, to look at: a video, or one picture of six frames, with the boxes drawn."""

from __future__ import annotations

import zlib
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

import cv2
import numpy as np
import numpy.typing as npt

from belie.types import RecordingError

if TYPE_CHECKING:
    from belie.simulation.stage import View

SUFFIXES = (".mp4", ".png")
Picture = npt.NDArray[np.uint8]

_PICTURES, _COLUMNS = 6, 3
_LEAST_VISIBLE = 0.1
_LEAST_NAMED = 0.06  # of the picture's height
_WHITE = (255, 255, 255)


class Preview:
    """Takes views in their order and writes what they show when it is closed.

    True objects are drawn as boxes in the colour of their class, with class and distance; what the object detector
    claims as thin white ones.

    Parameters
    ----------
    path : Path
        Ends in ``.mp4`` (all frames) or ``.png`` (six, evenly spread).
    frame_count : int
        How many views will come.
    rate_hz : float
        Of the video.

    Raises
    ------
    RecordingError
        On another ending, or where it cannot be written.
    """

    def __init__(self, path: Path, *, frame_count: int, rate_hz: float) -> None:
        require_suffix(path)
        self._path, self._rate_hz = path, rate_hz
        self._writer: cv2.VideoWriter | None = None
        self._chosen = set(
            np.linspace(0, frame_count - 1, min(_PICTURES, frame_count)).round().astype(int).tolist()
        )
        self._pictures: list[Picture] = []

    def __enter__(self) -> Preview:
        return self

    def add(self, view: View) -> None:
        """Draw one view."""
        if self._path.suffix == ".mp4":
            self._video(view.rendered.bgr.shape).write(drawn(view))
        elif view.index in self._chosen:
            self._pictures.append(drawn(view))

    def _video(self, shape: tuple[int, ...]) -> cv2.VideoWriter:
        if self._writer is None:
            codec = cv2.VideoWriter.fourcc(*"mp4v")
            self._writer = cv2.VideoWriter(str(self._path), codec, self._rate_hz, (shape[1], shape[0]))
            if not self._writer.isOpened():
                raise RecordingError(f"--preview {self._path}: OpenCV cannot write this video; use a .png")
        return self._writer

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        if self._writer is not None:
            self._writer.release()
        if self._pictures and kind is None and not cv2.imwrite(str(self._path), _sheet(self._pictures)):
            raise RecordingError(f"--preview {self._path}: cannot be written")


def require_suffix(path: Path) -> None:
    """Refuse an ending that is neither a video nor a picture.

    >>> require_suffix(Path("out.gif"))
    Traceback (most recent call last):
        ...
    belie.types.errors.RecordingError: --preview out.gif: the name must end in .mp4 or .png
    """
    if path.suffix not in SUFFIXES:
        raise RecordingError(f"--preview {path}: the name must end in {' or '.join(SUFFIXES)}")


def drawn(view: View) -> Picture:
    """The picture of a view with its boxes, shape (H, W, 3), BGR."""
    picture: Picture = view.rendered.bgr.copy()
    thick = max(1, round(picture.shape[1] / 640))
    for label in sorted(view.labels, key=lambda label: -label.distance_m):
        if label.visible < _LEAST_VISIBLE:
            continue
        colour = _colour(label.label)
        left, top, right, bottom = (round(float(edge) - 0.5) for edge in label.box_px)
        cv2.rectangle(picture, (left, top), (right, bottom), colour, thick)
        if bottom - top < _LEAST_NAMED * picture.shape[0]:
            continue  # names of what is far would hide each other
        text = f"{label.label} {label.distance_m:.0f} m"
        place = (left, max(10, top - 3))
        cv2.putText(picture, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.4 * thick, (0, 0, 0), thick + 1)
        cv2.putText(picture, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.4 * thick, colour, thick)
    for detection in view.detections.detections if view.detections is not None else ():
        if detection.box_px is not None:
            left, top, right, bottom = (round(float(edge) - 0.5) for edge in detection.box_px)
            cv2.rectangle(picture, (left, top), (right, bottom), _WHITE, 1)
    return picture


def _colour(label: str) -> tuple[int, int, int]:
    """A bright colour that stays a class's own."""
    hue = zlib.crc32(label.encode()) % 180
    blue, green, red = cv2.cvtColor(np.array([[[hue, 200, 255]]], np.uint8), cv2.COLOR_HSV2BGR)[0, 0]
    return int(blue), int(green), int(red)


def _sheet(pictures: list[Picture]) -> Picture:
    """Pictures side by side, rows of three; what is missing stays black."""
    columns = min(_COLUMNS, len(pictures))
    rows = -(-len(pictures) // columns)
    height, width, _ = pictures[0].shape
    sheet = np.zeros((rows * height, columns * width, 3), np.uint8)
    for i, picture in enumerate(pictures):
        row, column = divmod(i, columns)
        sheet[row * height : (row + 1) * height, column * width : (column + 1) * width] = picture
    return sheet
