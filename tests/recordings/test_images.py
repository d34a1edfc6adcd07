"""Every encoding to gray."""

import cv2
import numpy as np
import pytest

from belie.recordings.images import GrayDecoder, UndecodableImageError
from belie.types import TopicError

RNG = np.random.default_rng(0)
COLOUR = cv2.GaussianBlur(RNG.integers(0, 256, (32, 48, 3), dtype=np.uint8), (7, 7), 2)  # BGR
GRAY = cv2.cvtColor(COLOUR, cv2.COLOR_BGR2GRAY)


def raw(pixels, encoding, *, step=0, big_endian=False, height=32, width=48):
    data = np.ascontiguousarray(pixels).view(np.uint8).ravel()
    return GrayDecoder("/t").raw(
        data, encoding=encoding, height=height, width=width, step=step, big_endian=big_endian
    )


@pytest.mark.parametrize(
    ("encoding", "pixels"),
    [
        ("mono8", GRAY),
        ("8UC1", GRAY),
        ("bgr8", COLOUR),
        ("rgb8", COLOUR[:, :, ::-1]),
        ("bgra8", cv2.cvtColor(COLOUR, cv2.COLOR_BGR2BGRA)),
        ("rgba8", cv2.cvtColor(COLOUR, cv2.COLOR_BGR2RGBA)),
    ],
)
def test_colours_give_the_same_gray(encoding, pixels):
    np.testing.assert_array_equal(raw(pixels, encoding), GRAY)


@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
def test_bayer_patterns(pattern):
    # A coloured surface: a pattern taken for another would swap red and blue, and with them the gray.
    flat = np.empty((32, 48, 3), np.uint8)
    flat[:] = (20, 90, 220)
    channel = {"b": 0, "g": 1, "r": 2}
    mosaic = np.empty((32, 48), np.uint8)
    for place, colour in enumerate(pattern):
        mosaic[place // 2 :: 2, place % 2 :: 2] = flat[0, 0, channel[colour]]
    expected = int(cv2.cvtColor(flat, cv2.COLOR_BGR2GRAY)[0, 0])
    assert abs(int(raw(mosaic, f"bayer_{pattern}8")[10, 10]) - expected) <= 1


def test_padded_rows_and_a_short_last_row():
    padded = np.full((32, 64), 7, np.uint8)
    padded[:, :48] = GRAY
    np.testing.assert_array_equal(raw(padded, "mono8", step=64), GRAY)
    np.testing.assert_array_equal(raw(padded.ravel()[: 31 * 64 + 48], "mono8", step=64), GRAY)


@pytest.mark.parametrize("encoding", ["mono16", "16UC1"])
@pytest.mark.parametrize("big_endian", [False, True])
def test_sixteen_bits_are_scaled_robustly(encoding, big_endian):
    values = GRAY.astype(np.uint16) * 10 + 1000
    values[0, 0] = 65535  # a hot pixel must not darken the image
    out = raw(values.astype(">u2" if big_endian else "<u2"), encoding, big_endian=big_endian)
    low, high = np.percentile(GRAY, (0.5, 99.5))
    expected = np.clip((GRAY.astype(float) - low) / (high - low) * 255, 0, 255)
    assert np.abs(out.astype(float) - expected)[1:].max() <= 2


def test_the_sixteen_bit_scale_does_not_flicker():
    decoder = GrayDecoder("/t")
    dark, bright = np.full((8, 8), 100, np.uint16), np.full((8, 8), 400, np.uint16)
    dark[0], bright[0] = 1000, 1000
    dark[1], bright[1] = 0, 0

    def gray(values):
        data = values.view(np.uint8).ravel()
        return decoder.raw(data, encoding="mono16", height=8, width=8, step=16, big_endian=False)

    first = int(gray(dark)[4, 4])
    brighter = bright.copy()
    brighter[0] = 2000  # a reflection doubles the range in one frame
    assert abs(int(gray(brighter)[4, 4]) - 4 * first) <= 8


def test_yuv422():
    luminance = GRAY[:, :48]
    uyvy = np.full((32, 48, 2), 128, np.uint8)
    uyvy[:, :, 1] = luminance
    np.testing.assert_array_equal(raw(uyvy, "yuv422"), luminance)
    np.testing.assert_array_equal(raw(uyvy[:, :, ::-1], "yuv422_yuy2"), luminance)


def test_compressed_kinds():
    decoder = GrayDecoder("/t")
    png = cv2.imencode(".png", GRAY)[1].tobytes()
    np.testing.assert_array_equal(decoder.compressed(png), GRAY)
    np.testing.assert_array_equal(decoder.compressed(cv2.imencode(".bmp", GRAY)[1]), GRAY)
    jpeg = cv2.imencode(".jpg", COLOUR)[1].tobytes()
    assert np.abs(decoder.compressed(jpeg).astype(int) - GRAY).mean() < 3
    assert decoder.compressed(cv2.imencode(".png", GRAY.astype(np.uint16) * 200)[1]).dtype == np.uint8


def test_damage_is_told_from_harmless_stray_bytes():
    decoder = GrayDecoder("/t")
    jpeg = cv2.imencode(".jpg", GRAY)[1].tobytes()
    whole = decoder.compressed(jpeg)
    stray = jpeg[:-2] + b"\x00\x00\x00" + jpeg[-2:]
    np.testing.assert_array_equal(decoder.compressed(stray), whole)
    for broken in (
        jpeg[: len(jpeg) // 2],
        jpeg[:20],
        b"",
        b"hello",
        cv2.imencode(".png", GRAY)[1].tobytes()[:60],
    ):
        with pytest.raises(UndecodableImageError):
            decoder.compressed(broken)
    with pytest.raises(UndecodableImageError, match="bytes for 32 rows"):
        raw(GRAY[:16], "mono8")
    with pytest.raises(UndecodableImageError):
        raw(GRAY[:0], "mono8", height=0)


def test_unknown_encoding_is_a_topic_error():
    with pytest.raises(TopicError, match="encoded as '32FC1'"):
        raw(np.zeros((32, 48), np.float32), "32FC1")
