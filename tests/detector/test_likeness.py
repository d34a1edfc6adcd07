"""The picture of a soft object vouches for it under another name, and not for what took its place."""

import cv2
import numpy as np

from belie.detector.likeness import Likeness
from belie.odometry.local_features import ImageStack

BOX = np.array([60.0, 40.0, 76.0, 88.0])


def picture(seed, shift=0):
    """A soft blob of a person before a street, both of their own texture."""

    def soft(s, shape):
        return cv2.GaussianBlur(
            np.random.default_rng(s).integers(0, 255, shape).astype(np.float32), (0, 0), 4.0
        )

    image = 3.0 * (soft(1, (120, 160)) - 127.0) + 127.0
    if seed is not None:
        image[40:88, 60 + shift : 76 + shift] = 3.0 * (soft(seed, (48, 16)) - 127.0) + 127.0
    return ImageStack(np.clip(image, 0, 255).astype(np.uint8))


def known():
    likeness = Likeness()
    for k in range(4):
        likeness.learn(picture(5, k % 2), BOX + (k % 2) * np.array([1.0, 0.0, 1.0, 0.0]))
    return likeness


def test_the_same_object_is_known_again_in_two_messages():
    likeness = known()
    likeness.look(picture(5), BOX)
    likeness.look(picture(5, 1), BOX)
    assert likeness.vouches
    assert likeness.score > 0.9


def test_another_object_and_the_bare_street_are_not_it():
    for seed in (6, 7, None):
        likeness = known()
        for _ in range(3):
            likeness.look(picture(seed), BOX)
        assert not likeness.vouches


def test_what_has_no_contrast_says_nothing():
    likeness = Likeness()
    likeness.learn(ImageStack(np.full((120, 160), 90, np.uint8)), BOX)
    likeness.look(picture(5), BOX)
    assert likeness.evidence == 0.0
