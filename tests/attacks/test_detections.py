"""Lies about objects: every kind, on streams with and without ids, with boxes and in space; and their labels."""

from dataclasses import replace

import numpy as np
import pytest

from belie.attacks import attack
from belie.attacks.timing import NS_PER_S
from belie.geometry import SE3, CameraModel, box_iou, projected_box_px
from belie.types import AlertType, AttackError, Detection, DetectionClaim, Frame, MountedCamera, Step

PERIOD_NS = NS_PER_S // 10
MODEL = CameraModel(width=640, height=480, fx=500, fy=500, cx=319.5, cy=239.5)
CAMERA = MountedCamera(model=MODEL, T_body_cam=SE3.identity())
SIDES_M = np.array([4.0, 1.8, 1.6])


def moving(k):
    """A near car that drifts right, a far van, a person that comes into view at frame 25."""
    car = Detection(
        label="car", score=0.9, track_id="7", box_px=[200 + k, 220, 300 + k, 280], position_m=[-1, 1, 10.0]
    )
    van = Detection(
        label="van", score=0.8, track_id="3", box_px=[400, 225, 460 - 0.1 * k, 270], position_m=[3, 1, 20.0]
    )
    person = Detection(
        label="person", score=0.7, track_id="9", box_px=[20, 100, 180, 400], position_m=[-3, 1, 5.0]
    )
    return (car, van, person) if k >= 25 else (car, van)


class Road:
    """Sixty frames; `see` gives the detections of each, for each source."""

    def __init__(self, frames=60, **see):
        self.cameras, self.body_axes = {"/image": CAMERA}, "rdf"
        self._frames, self._see = frames, {f"/{name}": of for name, of in (see or {"boxes": moving}).items()}

    def frame_stamps_ns(self):
        return np.arange(self._frames) * PERIOD_NS

    def steps(self):
        for k in range(self._frames):
            stamp_ns = k * PERIOD_NS
            frame = Frame(
                camera="/image", stamp_ns=stamp_ns, received_ns=stamp_ns, image=np.zeros((480, 640), np.uint8)
            )
            claims = tuple(
                DetectionClaim(source=source, stamp_ns=stamp_ns, received_ns=stamp_ns, detections=of(k))
                for source, of in self._see.items()
            )
            yield Step(frame=frame, claims=claims)


def nameless(k):
    return tuple(replace(detection, track_id="") for detection in moving(k))


def solid(k):
    """The same objects as a LiDAR tells them: no boxes, attitude and dimensions."""
    return tuple(
        replace(
            d,
            box_px=None,
            position_m=None,
            T_cam_obj=SE3.from_translation(d.position_m),
            dimensions_m=SIDES_M,
        )
        for d in moving(k)
    )


def seen(recording, source="/boxes"):
    return [c.detections for step in recording.steps() for c in step.claims if c.source == source]


def run(text, road=None, source="/boxes"):
    """Detections of each frame, and the label."""
    attacked = attack(road or Road(), text)
    return seen(attacked, source), attacked.labels[0]


def test_hiding_takes_one_object_and_no_other():
    frames, label = run("detections-hide:start=20,stop=30")
    honest = seen(Road())
    for k, (found, true) in enumerate(zip(frames, honest, strict=True)):
        wanted = [d.track_id for d in true if not (20 <= k < 30 and d.track_id == "7")]
        assert [d.track_id for d in found] == wanted
    assert (label.object, label.alert, label.sources) == ("7", AlertType.OBSTACLE_HIDING, ("/boxes",))
    assert (label.onset_ns, label.end_ns) == (20 * PERIOD_NS, 30 * PERIOD_NS)


@pytest.mark.parametrize("kind", ["hide:", "relabel:", "shift:dx=0.3,", "patch:rate=0.99,"])
@pytest.mark.parametrize("stop", [",stop=40", ""])
def test_a_label_ends_with_the_last_lie(kind, stop):
    def leaves(k):  # the car goes at frame 25, and is seen once more
        return moving(k)[0 if k < 25 or k == 30 else 1 :]

    _, label = run(f"detections-{kind}start=20{stop}", Road(boxes=leaves))
    assert (label.onset_ns, label.stop_frame, label.end_ns) == (20 * PERIOD_NS, 31, 31 * PERIOD_NS)
    _, label = run(f"detections-{kind}start=20")
    assert (label.stop_frame, label.end_ns) == (60, 59 * PERIOD_NS)


def test_a_lie_lasts_until_the_next_message():
    class Slow(Road):
        """A detector that looks at every third frame."""

        def steps(self):
            for k, step in enumerate(super().steps()):
                yield step if k % 3 == 0 else replace(step, claims=())

    _, label = run("detections-hide:start=20,stop=30", Slow())
    assert (label.stop_frame, label.end_ns) == (30, 30 * PERIOD_NS)


def test_the_default_object_is_the_largest_that_is_held():
    # The person is larger, but was not there a second before the onset.
    assert run("detections-hide:start=30,stop=35")[1].object == "7"
    assert run("detections-hide:start=40,stop=45")[1].object == "9"
    # Nothing is held at the very start: the largest.
    assert run("detections-hide:start=0,stop=5")[1].object == "7"
    assert run("detections-hide:start=20,object=3")[1].object == "3"


def test_an_object_that_is_named_may_come_later():
    _, label = run("detections-hide:start=20,object=9")
    assert (label.object, label.start_ns, label.onset_ns) == ("9", 20 * PERIOD_NS, 25 * PERIOD_NS)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            "detections-hide:start=20,stop=24,object=9",
            r"no object 9 .* 20 to 24 \(it is told of in frames 25 to 59\); there /boxes has 7 \(car\), 3 \(van\)$",
        ),
        ("detections-relabel:start=20,object=x", "no object x to attack"),
        ("detections-hide:start=20,source=/radar", r"no detections claims of /radar"),
        (
            "detections-swap:start=20,other=x",
            "no object x to swap 7 with in frames 20 to 60; there /boxes has 9",
        ),
        (
            "detections-swap:start=20,stop=24,object=3,other=9",
            r"no object 9 to swap 3 with .* 25 to 59\); there",
        ),
        ("detections-swap:start=20,object=7,other=7", "needs two objects: object and other are both 7"),
        (
            "detections-relabel:start=20,object=7,to=car",
            "object 7 is called car already in frames 20 to 60; give",
        ),
        ("detections-phantom:start=20,distance=-1", "> 0"),
        ("detections-phantom:start=20,right=99", "out of the camera's view"),
        ("detections-phantom:start=20,x=700,y=0,w=9,h=9", "outside the image of 640x480"),
    ],
)
def test_an_object_that_is_not_there_is_an_error_in_one_line(text, says):
    for ask in (lambda: attack(Road(), text).labels, lambda: list(attack(Road(), text).steps())):
        with pytest.raises(AttackError, match=says) as caught:
            ask()
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", ["hide", "phantom", "swap", "delay"])
def test_where_no_messages_are_it_is_said_where_some_are(kind):
    class Ends(Road):
        """A detector that falls silent."""

        def steps(self):
            for k, step in enumerate(super().steps()):
                yield step if k < 30 else replace(step, claims=())

    text = f"detections-{kind}:start=40,stop=50"
    says = "no detections in frames 40 to 50: /boxes has messages in frames 0 to 29 alone; set start to 29 or less"
    for ask in (lambda: attack(Ends(), text).labels, lambda: list(attack(Ends(), text).steps())):
        with pytest.raises(AttackError, match=says):
            ask()
    if kind != "phantom":
        with pytest.raises(AttackError, match="object 99 is never told of, and no detections"):
            _ = attack(Ends(), f"{text},object=99").labels


def test_the_ten_largest_objects_are_named():
    def crowd(k):
        box_px = np.array([0.0, 0.0, 10.0, 10.0])
        return tuple(
            Detection(label="car", score=0.9, track_id=str(n), box_px=box_px * (n + 1)) for n in range(12)
        )

    with pytest.raises(AttackError, match=r"/boxes has 11 \(car\), .*, 2 \(car\), 2 smaller ones$"):
        run("detections-hide:start=20,object=x", Road(boxes=crowd))


def test_an_object_that_comes_in_the_attack_is_told_of():
    (caution,) = attack(Road(), "detections-relabel:start=20,object=9").cautions
    assert "object 9 is first told of in frame 25: start at 35 or later" in caution
    for text in ("relabel:start=26,object=9", "phantom:start=0", "delay:start=5"):
        assert attack(Road(), f"detections-{text}").cautions == ()


def test_relabelling_changes_the_label_alone():
    frames, label = run("paper-misclassification:start=20")
    for k, (found, true) in enumerate(zip(frames, seen(Road()), strict=True)):
        assert found[0].label == ("bird" if 20 <= k < 30 else "car")
        assert replace(found[0], label="car").box_px.tolist() == true[0].box_px.tolist()
        assert (found[0].track_id, found[0].score, found[0].position_m.tolist()) == ("7", 0.9, [-1, 1, 10])
        assert found[1].label == "van"
    assert (label.alert, label.object, label.stop_frame) == (AlertType.OBJECT_MISCLASSIFICATION, "7", 30)


def test_the_papers_hiding_lasts_ten_frames():
    frames, label = run("paper-hiding:start=20")
    assert [k for k, found in enumerate(frames) if found[0].track_id != "7"] == list(range(20, 30))
    assert (label.name, label.alert) == ("paper-hiding", AlertType.OBSTACLE_HIDING)


def test_shifting_moves_box_and_position_together():
    frames, label = run("detections-shift:start=20,stop=21,dx=0.5,dy=-0.25")
    true, moved = seen(Road())[20][0], frames[20][0]
    np.testing.assert_allclose(moved.box_px - true.box_px, [50, -15, 50, -15])
    assert moved.position_m[2] == true.position_m[2]
    np.testing.assert_allclose(
        MODEL.project(moved.position_m[None]) - MODEL.project(true.position_m[None]), [[50, -15]]
    )
    assert label.alert == AlertType.OBSTACLE_HIDING
    # Half out of the image it is clipped, wholly out it is gone.
    assert run("detections-shift:start=20,stop=21,dx=3.7")[0][20][0].box_px.tolist() == [
        590.0,
        220.0,
        640.0,
        280.0,
    ]
    assert [d.track_id for d in run("detections-shift:start=20,stop=21,dx=9")[0][20]] == ["3"]


def test_shifting_in_space_moves_the_projection():
    frames, _ = run("detections-shift:start=20,stop=21,dx=1", Road(solid=solid), "/solid")
    true, moved = seen(Road(solid=solid), "/solid")[20][0], frames[20][0]
    true_px, moved_px = projected_box_px(true, MODEL), projected_box_px(moved, MODEL)
    assert moved_px[0] - true_px[0] == pytest.approx(true_px[2] - true_px[0], rel=0.1)
    assert moved.T_cam_obj.t.tolist() == moved.position_m.tolist()
    assert moved.T_cam_obj.R.tolist() == true.T_cam_obj.R.tolist()


def test_shrinking_keeps_the_middle():
    frames, _ = run("detections-shrink:start=20,stop=21,factor=0.5")
    assert frames[20][0].box_px.tolist() == [245.0, 235.0, 295.0, 265.0]
    frames, _ = run("detections-shrink:start=20,stop=21,factor=0.5", Road(solid=solid), "/solid")
    assert frames[20][0].dimensions_m.tolist() == [2.0, 0.9, 0.8]
    assert frames[20][0].position_m.tolist() == [-1.0, 1.0, 10.0]


def test_a_swap_exchanges_ids_and_nothing_else():
    frames, label = run("detections-swap:start=20,stop=30")
    for k, found in enumerate(frames):
        assert [d.track_id for d in found][:2] == (["3", "7"] if 20 <= k < 30 else ["7", "3"])
        assert [d.label for d in found][:2] == ["car", "van"]
    assert (label.object, label.other, label.alert) == ("7", "3", AlertType.OBJECT_MISCLASSIFICATION)
    with pytest.raises(AttackError, match="gives no track ids"):
        list(attack(Road(boxes=nameless), "detections-swap:start=20").steps())


def test_delay_shows_old_boxes_under_new_stamps():
    frames, label = run("detections-delay:start=20,stop=40,delay=5")
    lefts = [found[0].box_px[0] - 200 for found in frames]
    assert lefts[18:30] == [18, 19, 19, 19, 19, 19, 19, 20, 21, 22, 23, 24]
    assert lefts[40] == 40
    assert (label.object, label.alert) == (None, AlertType.OBSTACLE_HIDING)


def test_delay_of_one_object_leaves_the_others():
    frames, label = run("detections-delay:start=20,stop=40,delay=5,object=7")
    assert [found[0].box_px[0] - 200 for found in frames][18:30] == [
        18,
        19,
        19,
        19,
        19,
        19,
        19,
        20,
        21,
        22,
        23,
        24,
    ]
    assert frames[30][1].box_px[2] == seen(Road())[30][1].box_px[2]
    assert label.object == "7"


@pytest.mark.parametrize(
    ("mode", "alert"), [("hide", "obstacle_hiding"), ("relabel", "object_misclassification")]
)
def test_a_patch_fools_the_detector_now_and_then(mode, alert):
    text = f"detections-patch:start=10,mode={mode},rate=0.6,seed=1"
    frames, label = run(text)
    fooled = [k for k, found in enumerate(frames) if (found[0].track_id, found[0].label) != ("7", "car")]
    assert 20 <= len(fooled) <= 40
    assert fooled[0] >= 10
    assert label.onset_ns == fooled[0] * PERIOD_NS
    assert label.alert == alert
    if mode == "relabel":
        assert frames[fooled[0]][0].label == "bird"
    others = run(text.replace("seed=1", "seed=2"))[0]
    assert [[d.label for d in found] for found in others] != [[d.label for d in found] for found in frames]


def test_without_ids_the_object_is_followed_by_its_box():
    frames, label = run("detections-hide:start=20,stop=50", Road(boxes=nameless))
    assert all(found[0].label == "van" for found in frames[20:50])
    assert all(found[0].label == "car" for found in (*frames[:20], *frames[50:]))
    assert label.object is None
    with pytest.raises(AttackError, match=r"no object 7 .* objects without track ids"):
        _ = attack(Road(boxes=nameless), "detections-hide:start=20,object=7").labels


def test_a_lost_track_is_followed_under_its_new_id():
    def renamed(k):
        car, *others = moving(k)
        if 25 <= k < 31:
            return tuple(others)
        return (replace(car, track_id="7" if k < 25 else "12"), *others)

    frames, label = run("detections-hide:start=20,stop=50", Road(boxes=renamed))
    assert all("car" not in [d.label for d in found] for found in frames[20:50])
    assert label.object == "7"


def test_streams_of_one_detector_tell_the_same_lie():
    for text, tells in (
        ("detections-hide:start=20", lambda found: [d.track_id for d in found]),
        ("detections-patch:start=20,rate=0.5", lambda found: [d.track_id for d in found]),
        ("detections-relabel:start=20", lambda found: [d.label for d in found]),
        ("detections-phantom:start=20", lambda found: [(d.track_id, d.label) for d in found]),
    ):
        attacked = attack(Road(boxes=moving, solid=solid), text)
        flat, deep = seen(attacked, "/boxes"), seen(attacked, "/solid")
        assert list(map(tells, flat)) == list(map(tells, deep)) != list(map(tells, seen(Road())))
        assert attacked.labels[0].sources == ("/boxes", "/solid")
        only = attack(Road(boxes=moving, solid=solid), f"{text},source=/solid")
        assert list(map(tells, seen(only))) == list(map(tells, seen(Road())))


class TestPhantom:
    def test_it_stands_on_the_road_ahead(self):
        frames, label = run("detections-phantom:start=20,stop=40")
        phantoms = [found[-1] for found in frames[20:40]]
        assert all(
            len(found) == len(true) for found, true in zip(frames[:20], seen(Road())[:20], strict=True)
        )
        assert {d.track_id for d in phantoms} == {label.object}
        assert label.object not in ("7", "3", "9")
        assert (label.alert, phantoms[0].label, phantoms[0].score) == (
            AlertType.OBSTACLE_INJECTION,
            "car",
            0.9,
        )
        left, top, right, bottom = phantoms[0].box_px
        assert left + right == pytest.approx(640.0)
        assert 240 <= top < bottom < 300  # below the horizon
        assert phantoms[0].position_m[2] == pytest.approx(20.0)
        assert phantoms[0].box_px.tolist() == phantoms[-1].box_px.tolist()

    def test_it_grows_as_a_real_object_would(self):
        frames, _ = run("detections-phantom:start=20,motion=approach,speed=4")
        first, last = frames[20][-1], frames[40][-1]
        assert last.position_m[2] == pytest.approx(20.0 - 4.0 * 2.0)
        assert np.ptp(last.box_px[[0, 2]]) > 1.5 * np.ptp(first.box_px[[0, 2]])
        # Never nearer than 4 m.
        assert run("detections-phantom:start=20,motion=approach,speed=90")[0][-1][-1].position_m[2] == 4.0

    def test_it_is_told_of_no_more_once_it_has_passed_out_of_the_image(self):
        frames, label = run("detections-phantom:start=10,x=20,y=20,w=80,h=60,motion=approach,speed=20")
        told = [any(d.track_id == label.object for d in found) for found in frames]
        last = max(k for k, is_told in enumerate(told) if is_told)
        assert told == [10 <= k <= last for k in range(len(frames))]
        assert last < len(frames) - 1
        assert label.end_ns == (last + 1) * PERIOD_NS

    def test_it_may_be_given_as_a_box(self):
        frames, _ = run("detections-phantom:start=20,x=100,y=200,w=50,h=75,label=truck")
        phantom = frames[20][-1]
        assert phantom.box_px.tolist() == [100, 200, 150, 275]
        assert phantom.position_m[2] == pytest.approx(500 * 3.2 / 75)
        np.testing.assert_allclose(MODEL.project(phantom.position_m[None]), [[124.5, 237.0]])

    def test_it_takes_the_form_of_its_stream(self):
        deep = run("detections-phantom:start=20", Road(solid=solid), "/solid")[0][20][-1]
        assert deep.box_px is None
        assert deep.dimensions_m.tolist() == [4.2, 1.8, 1.5]
        flat, label = run("detections-phantom:start=20", Road(boxes=nameless))
        assert (flat[20][-1].track_id, label.object) == ("", None)
        # A detector that has seen nothing yet: a box and an id.
        alone, label = run("detections-phantom:start=20", Road(boxes=lambda k: ()))
        assert (alone[20][-1].track_id, alone[20][-1].position_m) == (label.object, None)

    def test_the_camera_s_height_counts(self):
        road = Road()
        road.body_axes = "flu"
        R_body_cam = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
        high = MountedCamera(model=MODEL, T_body_cam=SE3(R_body_cam, np.array([0.0, 0.0, 3.0])))
        road.cameras = {"/image": high}
        bottom = run("detections-phantom:start=20", road)[0][20][-1].box_px[3]
        assert bottom == pytest.approx(240 + 500 * 3.0 / (20 - 2.1))

    def test_two_phantoms_have_two_ids(self):
        several = attack(Road(), ["detections-phantom:start=20", "detections-phantom:start=15,right=2"])
        names = {d.track_id for found in seen(several) for d in found}
        assert len(names) == 5
        assert {label.object for label in several.labels} == names - {"7", "3", "9"}


def test_hiding_one_after_the_other_names_both():
    several = attack(Road(), ["detections-hide:start=20", "detections-hide:start=20"])
    assert [label.object for label in several.labels] == ["7", "3"]
    assert all(found == () for found in seen(several)[20:25])


def test_overlap_is_told_by_boxes_that_are_projected():
    near, far = solid(0)
    assert box_iou(projected_box_px(near, MODEL), projected_box_px(far, MODEL)) < 0.3
