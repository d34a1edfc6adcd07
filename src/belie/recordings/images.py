"""Images of every encoding that robots record, to 8-bit gray.

Encodings are those of ``sensor_msgs/image_encodings.hpp``.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import simplejpeg

from belie.types import GrayImage, TopicError

_JPEG_MAGIC = b"\xff\xd8\xff"

# encoding: bytes per pixel, OpenCV's conversion to gray (None: gray already)
_EIGHT_BIT: dict[str, tuple[int, int | None]] = {
    "mono8": (1, None),
    "8uc1": (1, None),
    "rgb8": (3, cv2.COLOR_RGB2GRAY),
    "bgr8": (3, cv2.COLOR_BGR2GRAY),
    "8uc3": (3, cv2.COLOR_BGR2GRAY),
    "rgba8": (4, cv2.COLOR_RGBA2GRAY),
    "bgra8": (4, cv2.COLOR_BGRA2GRAY),
    "8uc4": (4, cv2.COLOR_BGRA2GRAY),
    # OpenCV names a mosaic by its second row's second and third pixel, ROS by the first row's first two.
    "bayer_rggb8": (1, cv2.COLOR_BayerBG2GRAY),
    "bayer_bggr8": (1, cv2.COLOR_BayerRG2GRAY),
    "bayer_gbrg8": (1, cv2.COLOR_BayerGR2GRAY),
    "bayer_grbg8": (1, cv2.COLOR_BayerGB2GRAY),
    "yuv422": (2, cv2.COLOR_YUV2GRAY_UYVY),
    "uyvy": (2, cv2.COLOR_YUV2GRAY_UYVY),
    "yuv422_yuy2": (2, cv2.COLOR_YUV2GRAY_YUY2),
    "yuyv": (2, cv2.COLOR_YUV2GRAY_YUY2),
    # Planar: the luminance comes first, and is all that we need.
    "nv12": (1, None),
    "nv21": (1, None),
    "nv24": (1, None),
}
_SIXTEEN_BIT: dict[str, int | None] = {
    "mono16": None,
    "16uc1": None,
    "bayer_rggb16": cv2.COLOR_BayerBG2GRAY,
    "bayer_bggr16": cv2.COLOR_BayerRG2GRAY,
    "bayer_gbrg16": cv2.COLOR_BayerGR2GRAY,
    "bayer_grbg16": cv2.COLOR_BayerGB2GRAY,
}


class UndecodableImageError(ValueError):
    """One image is damaged; the stream goes on without it."""


class GrayDecoder:
    """Decodes the images of one stream, in order.

    The 16-bit range in use is found from percentiles and followed slowly, so that neighbouring frames
    keep their brightness: a scale found anew for each frame would flicker.

    Examples
    --------
    >>> decoder = GrayDecoder("/camera/image_raw")
    >>> decoder.raw(np.arange(6, dtype=np.uint8), encoding="mono8", height=2, width=3)
    array([[0, 1, 2],
           [3, 4, 5]], dtype=uint8)
    """

    _FOLLOW = 0.05  # share of the new range that a frame contributes

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self._range: tuple[float, float] | None = None

    def raw(
        self, data: Any, *, encoding: str, height: int, width: int, step: int = 0, big_endian: bool = False
    ) -> GrayImage:
        """A ``sensor_msgs/Image`` to gray, shape (height, width); rows are `step` bytes apart.

        Raises
        ------
        UndecodableImageError
            If there is less data than the header says.
        TopicError
            If the encoding is not known, so that no image of the topic can be read.
        """
        name = encoding.lower()
        if name in _EIGHT_BIT:
            size, conversion = _EIGHT_BIT[name]
            rows = _rows(data, height, width * size, step)
            if size > 1:
                rows = rows.reshape(height, width, size)
            return _converted(rows, conversion)
        if name in _SIXTEEN_BIT:
            rows = _rows(data, height, width * 2, step)
            values = rows.view(">u2" if big_endian else "<u2").astype(np.uint16)
            return self._to_eight_bit(_converted(values, _SIXTEEN_BIT[name]))
        raise TopicError(
            f"images on {self.topic} are encoded as {encoding!r}, which belie cannot read "
            f"(it reads {', '.join([*_EIGHT_BIT, *_SIXTEEN_BIT])}); choose another topic with --image"
        )

    def compressed(self, data: Any) -> GrayImage:
        """A JPEG, PNG or other image file's bytes to gray, shape (height, width).

        Raises
        ------
        UndecodableImageError
            If the bytes are no whole image.
        """
        data = bytes(data)
        if data.startswith(_JPEG_MAGIC):
            return _jpeg(data)
        if not data:
            raise UndecodableImageError("an image of 0 bytes")
        try:
            image = cv2.imdecode(
                np.frombuffer(data, np.uint8), cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
            )
        except cv2.error as error:
            raise UndecodableImageError(f"an image of {len(data)} bytes: {error}") from error
        if image is None or image.size == 0:
            raise UndecodableImageError(f"{len(data)} bytes that start with {data[:8]!r} are no image")
        if image.dtype == np.uint16:
            return self._to_eight_bit(np.asarray(image))
        if image.dtype != np.uint8:
            raise TopicError(f"images on {self.topic} hold {image.dtype} values, not 8 or 16 bit gray")
        return np.asarray(image)

    def _to_eight_bit(self, values: npt.NDArray[np.uint16]) -> GrayImage:
        sample = values[:: max(1, values.shape[0] // 120), :: max(1, values.shape[1] // 160)]
        low, high = (float(v) for v in np.percentile(sample, (0.5, 99.5)))
        if self._range is not None:
            low = self._range[0] + self._FOLLOW * (low - self._range[0])
            high = self._range[1] + self._FOLLOW * (high - self._range[1])
        self._range = (low, high)
        scale = 255.0 / max(high - low, 1.0)
        return np.asarray(np.clip(np.rint((values - low) * scale), 0, 255), dtype=np.uint8)


def _rows(data: Any, height: int, row_bytes: int, step: int) -> npt.NDArray[np.uint8]:
    """The image's rows without their padding, shape (height, row_bytes)."""
    flat = np.frombuffer(data, np.uint8) if not isinstance(data, np.ndarray) else data.view(np.uint8)
    step = step or row_bytes
    if height < 1 or row_bytes < 1 or step < row_bytes or flat.size < step * (height - 1) + row_bytes:
        raise UndecodableImageError(f"{flat.size} bytes for {height} rows of {row_bytes} bytes, step {step}")
    if flat.size < step * height:  # the last row may lack its padding
        flat = np.pad(flat, (0, step * height - flat.size))
    return np.ascontiguousarray(flat[: step * height].reshape(height, step)[:, :row_bytes])


def _converted(image: npt.NDArray[Any], conversion: int | None) -> npt.NDArray[Any]:
    if conversion is None:
        return image
    try:
        return np.asarray(cv2.cvtColor(image, conversion))
    except cv2.error as error:
        raise UndecodableImageError(f"an image of {image.shape[1]}x{image.shape[0]}: {error}") from error


def _jpeg(data: bytes) -> GrayImage:
    try:
        return np.asarray(simplejpeg.decode_jpeg(data, colorspace="GRAY"))[:, :, 0]
    except ValueError as error:
        # Webcams leave stray bytes between markers: harmless. Anything else means lost pixels.
        if "extraneous bytes" not in str(error):
            raise UndecodableImageError(f"a JPEG of {len(data)} bytes: {error}") from error
    try:
        return np.asarray(simplejpeg.decode_jpeg(data, colorspace="GRAY", strict=False))[:, :, 0]
    except ValueError as error:
        raise UndecodableImageError(f"a JPEG of {len(data)} bytes: {error}") from error
