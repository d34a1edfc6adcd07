"""Camera attacks: pixels lie, stamps do not."""

import weakref

import numpy as np
import pytest

from belie.attacks import attack
from belie.types import AttackError, Frame, Step

SPAN = "start=10,stop=20"


@pytest.fixture
def images(curve):
    """True and shown images, after checking that nothing but images changed."""

    def collect(text, **options):
        source = curve(**options)
        true, shown = list(source.steps()), list(attack(source, text).steps())
        for a, b in zip(true, shown, strict=True):
            assert (a.frame.stamp_ns, a.frame.received_ns) == (b.frame.stamp_ns, b.frame.received_ns)
            assert a.claims == b.claims
            assert a.decode_ms == b.decode_ms
        changed = [
            k
            for k, (a, b) in enumerate(zip(true, shown, strict=True))
            if (a.frame.image != b.frame.image).any()
        ]
        assert set(changed) <= set(range(10, 20))
        return [s.frame.image for s in true], [s.frame.image for s in shown]

    return collect


def test_freeze(images):
    true, shown = images(f"camera-freeze:{SPAN}")
    assert all(np.array_equal(shown[k], true[9]) for k in range(10, 20))


def test_freeze_with_sensor_noise(images):
    true, shown = images(f"camera-freeze:noise=2,{SPAN}")
    grain = np.array([shown[k].astype(int) - true[9] for k in range(10, 20)])
    assert grain.std() == pytest.approx(2.0, rel=0.1)
    assert (grain[0] != grain[1]).any()


@pytest.mark.parametrize("delay", ["4", "0.4s"])
def test_replay_and_delay(images, delay):
    true, shown = images(f"camera-replay:delay={delay},{SPAN}")
    assert all(np.array_equal(shown[k], true[k - 4]) for k in range(10, 20))
    true, shown = images(f"camera-delay:delay={delay},{SPAN}")
    assert all(np.array_equal(shown[k], true[max(9, k - 4)]) for k in range(10, 20))


def test_black_noise_and_cover(images):
    _, shown = images(f"camera-black:{SPAN}")
    assert not any(shown[k].any() for k in range(10, 20))
    _, shown = images(f"camera-black:level=9,{SPAN}")
    assert all((shown[k] == 9).all() for k in range(10, 20))
    true, shown = images(f"camera-noise:sigma=5,{SPAN}")
    inner = (true[12] > 30) & (true[12] < 220)
    assert (shown[12].astype(int) - true[12])[inner].std() == pytest.approx(5.0, rel=0.3)
    true, shown = images(f"camera-cover:fraction=0.7,level=3,seed=2,{SPAN}")
    covered = shown[12] == 3
    assert covered.mean() == pytest.approx(0.7, abs=0.08)
    assert np.array_equal(shown[12][~covered], true[12][~covered])
    assert np.array_equal(shown[13] == 3, covered) or (true[13] == 3).any()


def test_cloth_is_textured_and_stands_still(images):
    _, shown = images(f"camera-cover:fraction=1,texture=cloth,level=40,{SPAN}")
    assert shown[10].std() > 20
    assert all(np.array_equal(shown[10], shown[k]) for k in range(10, 20))


def test_replay_keeps_few_images_in_memory(curve):
    class Counting:
        """Counts the images that are alive."""

        def __init__(self, source):
            self.cameras, self.body_axes = source.cameras, source.body_axes
            self.frame_stamps_ns, self._source = source.frame_stamps_ns, source
            self.alive = weakref.WeakSet()

        def steps(self):
            for step in self._source.steps():
                image = Image(step.frame.image)
                self.alive.add(image)
                frame = Frame(
                    camera="/image", stamp_ns=step.frame.stamp_ns, received_ns=0, image=image.view()
                )
                del image
                yield Step(frame=frame)

    class Image(np.ndarray):
        def __new__(cls, pixels):
            return np.array(pixels).view(cls)

        def __hash__(self):
            return id(self)

        def __eq__(self, other):
            return self is other

    source = Counting(curve(frames=120))
    most = 0
    for _ in attack(source, "camera-replay:delay=80,start=90").steps():
        most = max(most, len(source.alive))
    assert 0 < most <= 8


def test_only_the_named_camera(curve):
    with pytest.raises(AttackError, match="no such camera; the recording has /image"):
        attack(curve(), f"camera-black:source=/rear,{SPAN}")
    assert attack(curve(), f"camera-black:source=/image,{SPAN}").labels[0].sources == ("/image",)


class TwoCameras:
    """Frames of two cameras in turn, five milliseconds apart."""

    def __init__(self, source):
        self.cameras = {"/image": source.cameras["/image"], "/rear": source.cameras["/image"]}
        self.body_axes, self._source = source.body_axes, source

    def frame_stamps_ns(self):
        stamps = self._source.frame_stamps_ns()
        return np.column_stack([stamps, stamps + 5_000_000]).ravel()

    def steps(self):
        for step in self._source.steps():
            yield step
            stamp = step.frame.stamp_ns + 5_000_000
            image = 255 - step.frame.image
            yield Step(frame=Frame(camera="/rear", stamp_ns=stamp, received_ns=stamp, image=image))


def test_cameras_are_told_apart(curve):
    source = TwoCameras(curve())
    true = [step.frame.image for step in source.steps()]
    shown = [step.frame.image for step in attack(source, "camera-freeze:start=20,stop=40").steps()]
    assert all(np.array_equal(shown[k], true[18 + k % 2]) for k in range(20, 40))
    shown = [step.frame.image for step in attack(source, "camera-replay:delay=8,start=20,stop=40").steps()]
    assert all(np.array_equal(shown[k], true[k - 8]) for k in range(20, 40))
    shown = [
        step.frame.image
        for step in attack(source, "camera-black:source=/rear,level=7,start=20,stop=40").steps()
    ]
    assert [k for k in range(60) if (shown[k] == 7).all()] == list(range(21, 40, 2))
