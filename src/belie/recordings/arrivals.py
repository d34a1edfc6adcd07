"""What comes out of a recording before the streams are joined: claims and images, as received."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from typing import Any

from belie.recordings.images import UndecodableImageError
from belie.recordings.join import DecodedFrame, join
from belie.recordings.join_counts import JoinCounts
from belie.recordings.join_settings import JoinSettings
from belie.recordings.prefetch import prefetch
from belie.types import Claim, Frame, GrayImage, MountedCamera, RecordingError, Step


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RawImage:
    """An image that is not decoded yet; `payload` is what the format's decoder takes."""

    index: int
    stamp_ns: int
    received_ns: int
    payload: Any


def steps_of(
    arrivals: Generator[Claim | DecodedFrame, None, None],
    *,
    settings: JoinSettings,
    counts: JoinCounts,
    periods_ns: Mapping[str, float],
) -> Iterator[Step]:
    """Read `arrivals` ahead in a thread and join them; closing the iterator stops the thread."""
    with closing(prefetch(arrivals)) as ahead:
        yield from join(ahead, settings=settings, counts=counts, periods_ns=periods_ns)


def decode_frames(
    arrivals: Iterable[Claim | RawImage],
    decode: Callable[[Any], GrayImage],
    *,
    camera: str,
    mounted: MountedCamera,
    counts: JoinCounts,
) -> Iterator[Claim | DecodedFrame]:
    """Decode the images among the arrivals; claims pass. Undecodable images are counted and left out.

    Raises
    ------
    RecordingError
        If an image has another size than its camera, or none could be decoded.
    """
    images = decoded = 0
    size = (mounted.model.height, mounted.model.width)
    last_error = ""
    for arrival in arrivals:
        if not isinstance(arrival, RawImage):
            yield arrival
            continue
        images += 1
        start_s = time.perf_counter()
        try:
            image = decode(arrival.payload)
        except UndecodableImageError as error:
            counts.undecodable[camera] += 1
            last_error = str(error)
            continue
        decode_ms = (time.perf_counter() - start_s) * 1e3
        if image.shape != size:
            raise RecordingError(
                f"image {arrival.index} of {camera} is {image.shape[1]}x{image.shape[0]}, "
                f"its calibration is for {size[1]}x{size[0]}; images and calibration must be of one size"
            )
        decoded += 1
        frame = Frame(camera=camera, stamp_ns=arrival.stamp_ns, received_ns=arrival.received_ns, image=image)
        yield DecodedFrame(frame=frame, index=arrival.index, decode_ms=decode_ms)
    if images and not decoded:
        raise RecordingError(f"none of the {images} images of {camera} can be decoded ({last_error})")
