"""A recording with the detections of a model of one's own: ``--detector model.onnx``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from belie.recordings import Recording


def with_own_detector(
    recording: Recording, model: Path | None, names: Path | None, threads: int, *, remember: bool = False
) -> Recording:
    """Add what a model sees in the images; the recording as it is, where no model is named.

    `remember`: look at every image once, however often the recording is read.

    >>> with_own_detector("a recording", None, None, 2)
    'a recording'
    """
    if model is None:
        return recording
    from belie.recordings.onnx_detector import OnnxDetector, OnnxSettings, with_detector

    detector = OnnxDetector(model, names=names, settings=OnnxSettings(threads=threads))
    return with_detector(recording, detector, remember=remember)
