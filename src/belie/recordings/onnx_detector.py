"""A detector of one's own: any ONNX model in YOLO's output layout, run on the recording's images (extra ``onnx``)."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from belie.geometry import FloatArray
from belie.recordings.added_claims import AddedStream, ExtendedRecording
from belie.recordings.detection_files import read_names
from belie.recordings.recording import Recording
from belie.recordings.yolo import Candidates, Letterbox, decode, layout_of, without_doubles
from belie.types import Detection, DetectionClaim, Frame, MissingExtraError, RecordingError, Settings

_USUAL_SIDE_PX = 640
_TYPES = {"tensor(float)": np.float32, "tensor(float16)": np.float16}


class OnnxSettings(Settings):
    """How an ONNX detector is run.

    >>> OnnxSettings().threads
    2
    """

    least_score: float = Field(0.25, description="boxes that score less are left out", ge=0.0, le=1.0)
    overlap: float = Field(
        0.45,
        description="of two boxes of one class that overlap by more, the better one stays [IoU]",
        gt=0.0,
        le=1.0,
    )
    threads: int = Field(
        2, description="threads that the model may take; the rest of belie needs some, too", ge=1
    )


class OnnxDetector:
    """An ONNX model with one image input and one output in YOLO's layout.

    Parameters
    ----------
    path : Path
        The model.
    names : Path, optional
        Names of its classes, one a line; by default those in the model's metadata (as Ultralytics writes them), else
        numbers.
    settings : OnnxSettings, optional
        Thresholds and threads.

    Raises
    ------
    MissingExtraError
        If onnxruntime is not installed.
    RecordingError
        If the model cannot be loaded, or is of another kind.
    """

    def __init__(
        self, path: Path, *, names: Path | None = None, settings: OnnxSettings | None = None
    ) -> None:
        self.source = f"detector:{path.stem}"
        self._settings = settings or OnnxSettings()
        self._session = _session(path, self._settings.threads)
        self._path = path
        inputs = self._session.get_inputs()
        shape: list[Any] = list(inputs[0].shape) if len(inputs) == 1 else []
        # A side that the model leaves open is a name, or None.
        if len(shape) != 4 or (isinstance(shape[1], int) and shape[1] != 3) or inputs[0].type not in _TYPES:
            raise RecordingError(f"{path}: expected one input of 1x3xHxW floats, found {_told(inputs)}")
        self._input, self._type = inputs[0].name, _TYPES[inputs[0].type]
        height, width = (side if isinstance(side, int) else _USUAL_SIDE_PX for side in shape[2:])
        self._shape = (height, width)
        self._names = read_names(names) if names is not None else _names_in(self._session)

    def look(self, frame: Frame) -> DetectionClaim:
        """What the model sees in a frame."""
        letterbox = Letterbox.of(frame.image.shape, self._shape)
        blob = letterbox.blob(frame.image, self._shape).astype(self._type)
        output = self._run(blob)
        layout = layout_of(output.shape, len(self._names) or None)
        found = decode(output, layout, least_score=self._settings.least_score)
        found = without_doubles(found, overlap=self._settings.overlap)
        boxes = letterbox.to_image(found.boxes)
        return DetectionClaim(
            source=self.source,
            stamp_ns=frame.stamp_ns,
            received_ns=frame.received_ns,
            detections=self._detections(boxes, found, frame),
        )

    def _run(self, blob: Any) -> Any:
        try:
            return self._session.run(None, {self._input: blob})[0]
        except Exception as error:  # onnxruntime's errors share no base class
            size = f"1x3x{self._shape[0]}x{self._shape[1]}"
            raise RecordingError(
                f"{self._path} cannot be run on an input of {size}: {_first_line(error)}"
            ) from error

    def _detections(self, boxes: FloatArray, found: Candidates, frame: Frame) -> tuple[Detection, ...]:
        """Boxes clipped to the image; what nothing is left of is no detection."""
        height, width = frame.image.shape
        clipped = np.clip(boxes, 0.0, (width, height, width, height))
        return tuple(
            Detection(label=self._label(int(number)), score=min(float(score), 1.0), box_px=box)
            for box, score, number in zip(clipped, found.scores, found.classes, strict=True)
            if (box[2:] > box[:2]).all()
        )

    def _label(self, number: int) -> str:
        return self._names[number] if number < len(self._names) else str(number)


def with_detector(
    recording: Recording, detector: OnnxDetector, *, remember: bool = False
) -> ExtendedRecording:
    """The recording with one claim a frame of what the detector sees in it.

    The claims of the detector come without delay: they are received with their frame. With `remember` they are kept, so
    that the model looks at every image once, however often the recording is read.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> bare = SimpleNamespace(path="x", format="made", cameras={}, body_axes="flu", join_counts=None, streams=(),
    ...                        geodetic_origin=None, frame_stamps_ns=lambda: np.array([5, 9]))
    >>> [stream.topic for stream in with_detector(bare, SimpleNamespace(source="detector:tiny")).streams]
    ['detector:tiny']
    """
    kept: dict[int, DetectionClaim] = {}

    def look(frame: Frame) -> tuple[DetectionClaim]:
        claim = kept.get(frame.stamp_ns) or detector.look(frame)
        if remember:
            kept[frame.stamp_ns] = claim
        return (claim,)

    added = AddedStream(
        topic=detector.source,
        kind="ONNX model",
        stamps_ns=recording.frame_stamps_ns(),
        start=lambda: look,
    )
    return ExtendedRecording(recording, added)


def _session(path: Path, threads: int) -> Any:
    if not path.is_file():
        raise RecordingError(f"--detector {path}: no such file")
    try:
        import onnxruntime
    except ImportError as error:
        raise MissingExtraError("onnxruntime", "onnx") from error
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
    options.log_severity_level = 3  # errors alone
    try:
        return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime's errors share no base class
        raise RecordingError(f"{path} is no ONNX model that can be run: {_first_line(error)}") from error


def _first_line(error: Exception) -> str:
    return (str(error).strip() or type(error).__name__).splitlines()[0]


def _told(inputs: Sequence[Any]) -> str:
    return ", ".join(f"{one.name} {one.type} {'x'.join(map(str, one.shape))}" for one in inputs) or "none"


def _names_in(session: Any) -> tuple[str, ...]:
    """Names from the metadata, ``{0: 'person', 1: 'bicycle', …}``; none where there are none."""
    text = session.get_modelmeta().custom_metadata_map.get("names", "")
    try:
        names = ast.literal_eval(text)
        return tuple(str(names[number]) for number in range(len(names)))
    except (ValueError, SyntaxError, KeyError, TypeError):
        return ()
