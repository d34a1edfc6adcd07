"""The camera image with the verdict drawn in, for a person who looks over the robot's shoulder."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import numpy.typing as npt
import simplejpeg

from belie.bridges.board import Answer
from belie.bridges.sinks.sink import SinkBase
from belie.bridges.wire import now_ns
from belie.recordings.messages import STORE, header, new
from belie.recordings.topics import COMPRESSED
from belie.types import GrayImage, Status, Verdict

_COLOUR = {
    Status.CONSISTENT: (60, 200, 60),
    Status.UNDECIDED: (230, 180, 40),
    Status.CONTRADICTED: (240, 50, 50),
}
_WIDEST_PX = 960
_QUALITY = 75


def drawn(image: GrayImage, verdict: Verdict) -> npt.NDArray[np.uint8]:
    """The image in colour, at most 960 px wide, with a frame and one line a check; shape (h, w, 3), RGB.

    >>> verdict = Verdict(frame=0, stamp_ns=0, status=Status.CONSISTENT, latency_ms=1.0)
    >>> drawn(np.zeros((60, 80), np.uint8), verdict).shape
    (60, 80, 3)
    """
    scale = min(1.0, _WIDEST_PX / image.shape[1])
    small = np.asarray(image) if scale == 1.0 else cv2.resize(image, None, fx=scale, fy=scale)
    canvas = cv2.cvtColor(small, cv2.COLOR_GRAY2RGB)
    height, width = canvas.shape[:2]
    cv2.rectangle(canvas, (1, 1), (width - 2, height - 2), _COLOUR[verdict.status], 3)
    for row, check in enumerate(verdict.checks[: max(1, height // 20)]):
        text = f"{check.check} {check.source} {check.status.value} {check.object or ''}"
        where = (8, 20 + 18 * row)
        cv2.putText(canvas, text, where, cv2.FONT_HERSHEY_SIMPLEX, 0.45, (0, 0, 0), 3, cv2.LINE_AA)
        cv2.putText(
            canvas, text, where, cv2.FONT_HERSHEY_SIMPLEX, 0.45, _COLOUR[check.status], 1, cv2.LINE_AA
        )
    return np.asarray(canvas, dtype=np.uint8)


class AnnotatedSink(SinkBase):
    """Publishes drawn images as JPEG, not more often than asked for."""

    def __init__(self, publish: Callable[[bytes], None], rate_hz: float) -> None:
        self._publish, self._pause_ns = publish, round(1e9 / rate_hz)
        self._last_ns = 0

    def answer(self, answer: Answer) -> None:
        """Draw and publish, where the last one is old enough, or an alert was raised."""
        now = now_ns()
        if now - self._last_ns < self._pause_ns and not answer.verdict.alerts:
            return
        self._last_ns = now
        image = drawn(answer.frame.image, answer.verdict)
        data = np.frombuffer(simplejpeg.encode_jpeg(image, _QUALITY, "RGB"), np.uint8)
        message = new(COMPRESSED, header=header(answer.verdict.stamp_ns, ""), format="jpeg", data=data)
        self._publish(bytes(STORE.serialize_cdr(message, COMPRESSED)))
