"""Images to a YOLO network's input and its output to boxes: letterbox, the two output layouts, suppression of doubles.

A model of C classes answers in one of two layouts: 1 x N x (5 + C), that of YOLOv5 (box, objectness, classes), or
1 x (4 + C) x N, that of YOLOv8 and later (box, classes). Boxes are centre x, centre y, width, height in pixels of the
network's input.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import cv2
import numpy as np
import numpy.typing as npt

from belie.geometry import FloatArray
from belie.types import GrayImage, RecordingError

Layout = Literal["v5", "v8"]
_GRAY_BORDER = 114  # what the networks are trained with


@dataclass(frozen=True, slots=True, kw_only=True)
class Letterbox:
    """How an image lies in a network's input: scaled evenly and centred, the border gray.

    Examples
    --------
    >>> box = Letterbox.of((480, 640), (640, 640))
    >>> box.scale, box.left, box.top
    (1.0, 0, 80)
    >>> box.to_image(np.array([[10.0, 90.0, 20.0, 110.0]]))
    array([[10., 10., 20., 30.]])
    """

    scale: float
    left: int
    top: int
    width: int
    height: int

    @classmethod
    def of(cls, image_shape: tuple[int, int], input_shape: tuple[int, int]) -> Letterbox:
        """For images and inputs of (height, width)."""
        scale = min(input_shape[0] / image_shape[0], input_shape[1] / image_shape[1])
        height, width = (max(1, round(side * scale)) for side in image_shape)
        top, left = (input_shape[0] - height) // 2, (input_shape[1] - width) // 2
        return cls(scale=scale, left=left, top=top, width=width, height=height)

    def blob(self, image: GrayImage, input_shape: tuple[int, int]) -> npt.NDArray[np.float32]:
        """The network's input, shape (1, 3, height, width), 0 to 1: the gray image in each of three channels."""
        canvas = np.full(input_shape, _GRAY_BORDER, np.uint8)
        resized = cv2.resize(image, (self.width, self.height), interpolation=cv2.INTER_LINEAR)
        canvas[self.top : self.top + self.height, self.left : self.left + self.width] = resized
        return np.repeat(canvas.astype(np.float32)[None, None] / np.float32(255.0), 3, axis=1)

    def to_image(self, boxes: FloatArray) -> FloatArray:
        """Left, top, right, bottom in the input to the same in the image, shape (N, 4)."""
        return np.asarray((boxes - (self.left, self.top, self.left, self.top)) / self.scale)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Candidates:
    """What a network proposes: boxes (left, top, right, bottom), shape (N, 4); scores and classes, shape (N,)."""

    boxes: FloatArray
    scores: FloatArray
    classes: npt.NDArray[np.int64]


def layout_of(shape: tuple[int, ...], class_count: int | None) -> Layout:
    """Which layout an output has; without a number of classes, the longer side counts the boxes.

    Raises
    ------
    RecordingError
        If it is neither.

    Examples
    --------
    >>> layout_of((1, 25200, 85), 80), layout_of((1, 84, 8400), 80), layout_of((1, 84, 8400), None)
    ('v5', 'v8', 'v8')
    """
    if len(shape) == 3 and shape[0] == 1:
        _, rows, columns = shape
        if class_count is None:
            if columns < rows and columns > 5:
                return "v5"
            if rows < columns and rows > 4:
                return "v8"
        elif columns == 5 + class_count:
            return "v5"
        elif rows == 4 + class_count:
            return "v8"
    wanted = "C classes" if class_count is None else f"{class_count} classes"
    raise RecordingError(
        f"the detector's output has shape {'x'.join(map(str, shape))}; for {wanted} belie reads 1xNx(5+C) (YOLOv5) and "
        "1x(4+C)xN (YOLOv8): export it without built-in suppression, and give its names with --detector-labels"
    )


def decode(output: npt.NDArray[Any], layout: Layout, *, least_score: float) -> Candidates:
    """The proposals of an output that score at least so much.

    >>> output = np.zeros((1, 6, 3))
    >>> output[0, :, 1] = 50.0, 40.0, 20.0, 10.0, 0.1, 0.9
    >>> found = decode(output, "v8", least_score=0.25)
    >>> found.boxes.tolist(), found.scores.tolist(), found.classes.tolist()
    ([[40.0, 35.0, 60.0, 45.0]], [0.9], [1])
    """
    table = np.asarray(output[0], dtype=np.float64)
    table = table.T if layout == "v8" else table
    scores = table[:, 4:] if layout == "v8" else table[:, 5:] * table[:, 4:5]
    classes = scores.argmax(axis=1)
    best = scores.max(axis=1)
    kept = np.isfinite(table).all(axis=1) & (best >= least_score) & (table[:, 2:4] > 0.0).all(axis=1)
    centre, half = table[kept, :2], 0.5 * table[kept, 2:4]
    return Candidates(
        boxes=np.concatenate([centre - half, centre + half], axis=1), scores=best[kept], classes=classes[kept]
    )


def without_doubles(found: Candidates, *, overlap: float) -> Candidates:
    """The best of every group of boxes of one class that overlap by more than `overlap` (IoU), the best first.

    >>> boxes = np.array([[0, 0, 10, 10], [1, 0, 11, 10], [1, 0, 11, 10]], float)
    >>> found = Candidates(boxes=boxes, scores=np.array([0.5, 0.9, 0.3]), classes=np.array([0, 0, 1]))
    >>> without_doubles(found, overlap=0.45).scores.tolist()
    [0.9, 0.3]
    """
    if not len(found.scores):
        return found
    # Boxes of different classes are moved apart, so that they never suppress each other.
    apart = found.classes[:, None] * (float(np.abs(found.boxes).max()) * 2.0 + 1.0)
    sides = found.boxes[:, 2:] - found.boxes[:, :2]
    rectangles = np.concatenate([found.boxes[:, :2] + apart, sides], axis=1)
    kept = cv2.dnn.NMSBoxes(rectangles.tolist(), found.scores.tolist(), 0.0, overlap)
    order = np.asarray(kept, dtype=np.int64).ravel()
    return Candidates(boxes=found.boxes[order], scores=found.scores[order], classes=found.classes[order])
