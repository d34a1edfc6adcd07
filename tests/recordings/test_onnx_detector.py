"""An ONNX model as detector: both YOLO layouts from tiny generated graphs, and models that are none."""

import builtins

import numpy as np
import pytest

from belie.recordings import open_recording
from belie.recordings.onnx_detector import OnnxDetector, OnnxSettings, with_detector
from belie.recordings.yolo import Candidates, Letterbox, decode, layout_of, without_doubles
from belie.types import DetectionClaim, Frame, MissingExtraError, RecordingError

onnx = pytest.importorskip("onnx")
pytest.importorskip("onnxruntime")

SIDE = 96
# Centre, size in the input of 96 x 96; an image of 64 x 48 fills 96 x 72 of it, from row 12.
BOX = (48.0, 48.0, 30.0, 24.0)
IN_IMAGE = (22.0, 16.0, 42.0, 32.0)


def model(path, layout, *, side=SIDE, names=None, classes=3, channels=3, box=BOX):
    """A network that sees one box of class 1 in any image but a black one: its score is the brightest pixel's."""
    helper, proto = onnx.helper, onnx.TensorProto
    rows = np.zeros((4, 4 + classes + (layout == "v5")), np.float32)
    rows[0, :4] = box
    rows[0, -classes + 1] = 0.9
    rows[1, :4] = np.array(box) + 1.0  # a double, a little worse
    rows[1, -classes + 1] = 0.8
    if layout == "v5":
        rows[:, 4] = 1.0
    gain = np.zeros_like(rows)
    gain[:, -classes:] = rows[:, -classes:]
    base = rows - gain
    if layout == "v8":
        base, gain = base.T, gain.T
    constants = [
        onnx.numpy_helper.from_array(np.ascontiguousarray(array[None]), name)
        for name, array in (("base", base), ("gain", gain))
    ]
    nodes = [
        helper.make_node("ReduceMax", ["images"], ["brightest"], axes=[1, 2, 3], keepdims=0),
        helper.make_node("Mul", ["gain", "brightest"], ["scored"]),
        helper.make_node("Add", ["base", "scored"], ["output"]),
    ]
    graph = helper.make_graph(
        nodes,
        "tiny",
        [helper.make_tensor_value_info("images", proto.FLOAT, [1, channels, side, side])],
        [helper.make_tensor_value_info("output", proto.FLOAT, None)],
        constants,
    )
    built = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)])
    built.ir_version = 8
    if names:
        helper.set_model_props(built, {"names": names})
    onnx.save(built, str(path))
    return path


def frame(level=255, stamp_ns=5):
    return Frame(camera="/c", stamp_ns=stamp_ns, received_ns=9, image=np.full((48, 64), level, np.uint8))


@pytest.mark.parametrize("layout", ["v5", "v8"])
@pytest.mark.parametrize(
    ("side", "box", "in_image"),
    [(SIDE, BOX, IN_IMAGE), ("side", (320.0, 320.0, 300.0, 240.0), (17.0, 12.0, 47.0, 36.0))],
    ids=["fixed", "open"],  # an open size is taken for 640 x 640
)
def test_one_box(tmp_path, layout, side, box, in_image):
    names = tmp_path / "names.txt"
    names.write_text("person\ncar\ntruck\n")
    path = model(tmp_path / "tiny.onnx", layout, side=side, box=box)
    # The gray border keeps even a black image from being black.
    detector = OnnxDetector(path, names=names, settings=OnnxSettings(threads=1, least_score=0.5))
    claim = detector.look(frame())
    assert (claim.source, claim.stamp_ns, claim.received_ns) == ("detector:tiny", 5, 9)
    (found,) = claim.detections
    assert (found.label, found.track_id) == ("car", "")
    assert found.score == pytest.approx(0.9, abs=1e-3)
    np.testing.assert_allclose(found.box_px, in_image, atol=1e-4)
    assert detector.look(frame(level=0)).detections == ()


def test_names_from_the_model_or_numbers(tmp_path):
    named = model(tmp_path / "named.onnx", "v8", names="{0: 'person', 1: 'bicycle', 2: 'car'}")
    assert OnnxDetector(named).look(frame()).detections[0].label == "bicycle"
    # Without names the longer side counts the boxes: seven numbers each, four boxes, read the wrong way round.
    bare = OnnxDetector(model(tmp_path / "bare.onnx", "v8", names="not a dict"))
    with pytest.raises(RecordingError, match="shape 1x7x4; for C classes belie reads"):
        bare.look(frame())


def test_a_recording_with_a_detector(tmp_path, new_bag):
    names = tmp_path / "names.txt"
    names.write_text("person\ncar\ntruck\n")
    detector = OnnxDetector(model(tmp_path / "tiny.onnx", "v8"), names=names)
    recording = with_detector(open_recording(new_bag().drive().write()), detector)
    for _ in range(2):
        steps = list(recording.steps())
        claims = [[c for c in step.claims if isinstance(c, DetectionClaim)] for step in steps]
        assert [[c.stamp_ns for c in found] for found in claims] == [[step.frame.stamp_ns] for step in steps]
        assert all(c.detections[0].label == "car" for found in claims for c in found)
        assert all(len(step.claims) > 1 for step in steps)
    (stream,) = [stream for stream in recording.streams if stream.role == "detections"]
    assert (stream.topic, stream.message_type, stream.count) == ("detector:tiny", "ONNX model", 5)


def test_what_a_detector_saw_is_remembered_where_asked(tmp_path, new_bag, monkeypatch):
    names = tmp_path / "names.txt"
    names.write_text("person\ncar\ntruck\n")
    detector = OnnxDetector(model(tmp_path / "tiny.onnx", "v8"), names=names)
    looked = []
    monkeypatch.setattr(detector, "_run", lambda blob, run=detector._run: looked.append(1) or run(blob))
    recording = with_detector(open_recording(new_bag().drive().write()), detector, remember=True)
    first, second = ([step.claims for step in recording.steps()] for _ in range(2))
    assert len(looked) == 5
    assert [claims[-1].stamp_ns for claims in first] == [claims[-1].stamp_ns for claims in second]


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda p: p / "none.onnx", "no such file"),
        (
            lambda p: (p / "text.onnx", (p / "text.onnx").write_text("hello"))[0],
            "is no ONNX model that can be run",
        ),
        (
            lambda p: model(p / "gray.onnx", "v8", channels=1),
            "expected one input of 1x3xHxW floats, found images",
        ),
    ],
)
def test_models_that_are_none(tmp_path, make, says):
    with pytest.raises(RecordingError, match=says) as caught:
        OnnxDetector(make(tmp_path))
    assert "\n" not in str(caught.value)


def test_names_that_do_not_fit(tmp_path):
    names = tmp_path / "names.txt"
    names.write_text("person\ncar\n")
    detector = OnnxDetector(model(tmp_path / "tiny.onnx", "v8"), names=names)
    with pytest.raises(RecordingError, match=r"shape 1x7x4; for 2 classes .* --detector-labels"):
        detector.look(frame())


def test_a_missing_extra_prints_the_pip_line(tmp_path, monkeypatch):
    real = builtins.__import__

    def without(name, *arguments, **options):
        if name == "onnxruntime":
            raise ImportError(name)
        return real(name, *arguments, **options)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(MissingExtraError, match=r"run: pip install 'belie\[onnx\]'"):
        OnnxDetector(model(tmp_path / "any.onnx", "v8"))


def test_letterbox_there_and_back():
    for shape in ((480, 640), (375, 1242), (640, 640), (900, 300)):
        box = Letterbox.of(shape, (640, 640))
        image = np.zeros(shape, np.uint8)
        blob = box.blob(image, (640, 640))
        assert blob.shape == (1, 3, 640, 640)
        assert blob.dtype == np.float32
        assert (blob[0, 0, box.top : box.top + box.height, box.left : box.left + box.width] == 0).all()
        whole = np.array([[box.left, box.top, box.left + box.width, box.top + box.height]], float)
        np.testing.assert_allclose(box.to_image(whole)[0], [0, 0, shape[1], shape[0]], atol=1.5)


def test_layouts_and_proposals():
    assert layout_of((1, 300, 6), 1) == "v5"
    with pytest.raises(RecordingError, match="shape 1x300x6; for 80 classes"):
        layout_of((1, 300, 6), 80)
    with pytest.raises(RecordingError, match="shape 8400x84"):
        layout_of((8400, 84), None)
    output = np.zeros((1, 3, 7))
    output[0, 0] = 10, 10, 4, 4, 0.5, 0.2, 0.8
    output[0, 1] = 10, 10, 4, 4, np.nan, 0.2, 0.8
    output[0, 2] = 10, 10, 0, 4, 1.0, 0.2, 0.8
    found = decode(output, "v5", least_score=0.3)
    assert found.scores.tolist() == [0.4]
    nothing = Candidates(boxes=np.zeros((0, 4)), scores=np.zeros(0), classes=np.zeros(0, np.int64))
    assert without_doubles(nothing, overlap=0.5) is nothing
