"""Images that claim to be larger than they may be, told from their headers: nothing is allocated for them."""

from __future__ import annotations

from typing import Any

import simplejpeg

_PNG_MAGIC = b"\x89PNG\r\n\x1a\n"


def claimed_pixels(message: Any) -> int:
    """Pixels that a ``sensor_msgs/Image`` or ``CompressedImage`` says it has; 0 where its header does not tell.

    >>> from types import SimpleNamespace
    >>> claimed_pixels(SimpleNamespace(encoding="mono8", height=30_000, width=40_000))
    1200000000
    """
    if hasattr(message, "encoding"):
        return int(message.height) * int(message.width)
    start = bytes(message.data[:24])
    if start.startswith(b"\xff\xd8\xff"):
        try:
            height, width, *_ = simplejpeg.decode_jpeg_header(bytes(message.data), strict=False)
        except ValueError:
            return 0
        return int(height) * int(width)
    if start.startswith(_PNG_MAGIC):
        return int.from_bytes(start[16:20], "big") * int.from_bytes(start[20:24], "big")
    return 0
