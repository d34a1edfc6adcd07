"""Runs of images that were shown before."""

from __future__ import annotations

from dataclasses import dataclass

from belie.checks.camera_settings import CameraSettings
from belie.checks.image_memory import ExactMemory, NearMemory, OldImage
from belie.checks.image_signature import ImageSignature


@dataclass(slots=True)
class ReplayRun:
    """A run of repeats: `last` is the old image repeated last, `distinct` counts the different ones."""

    since_ns: int
    last: OldImage
    exact: bool
    count: int = 1
    distinct: int = 1


class ReplaySearch:
    """Finds each image among the older ones, and remembers it where it is new.

    Examples
    --------
    >>> import numpy as np
    >>> from belie.checks.image_signature import image_signature
    >>> rng = np.random.default_rng(0)
    >>> drive = [image_signature(rng.integers(0, 256, (72, 128), dtype=np.uint8)) for _ in range(9)]
    >>> search, before = ReplaySearch(CameraSettings()), None
    >>> for k, image in enumerate(drive + drive[2:4]):
    ...     found = search.look(image, before, k, path_px=9.0 * k, blank=False, unchanged=False)
    ...     before = image
    >>> found, search.run.count, search.run.since_ns, search.run.last.path_px
    (True, 2, 9, 27.0)
    """

    def __init__(self, settings: CameraSettings) -> None:
        s = settings
        self._exact = ExactMemory(s.exact_images)
        self._near = NearMemory(
            capacity=s.near_images,
            span_ns=int(s.near_s * 1e9),
            match_ratio=s.near_ratio,
            least_lag=s.near_lag,
        )
        self._images = 0
        self.run: ReplayRun | None = None

    def look(
        self, image: ImageSignature, before: ImageSignature | None, stamp_ns: int, path_px: float,
        *, blank: bool, unchanged: bool,
    ) -> bool:  # fmt: skip
        """Take in an image; True if it, or the run that it belongs to, was shown before.

        Parameters
        ----------
        before : ImageSignature or None
            The image shown just before.
        path_px : float
            How far the claims have moved the image so far.
        blank, unchanged : bool
            Blank images are all alike, and an unchanged one is neither new nor a step in an old sequence.
        """
        self._images += 1
        if blank:
            self.run = None
        elif unchanged:
            if self.run is not None:
                self.run.count += 1
        else:
            self._search(image, before, stamp_ns, path_px)
        return self.run is not None

    def _search(
        self, image: ImageSignature, before: ImageSignature | None, stamp_ns: int, path_px: float
    ) -> None:
        old = self._exact.find(image.digest)
        exact = old is not None
        if old is None and before is not None:
            old = self._find_near(image, before, stamp_ns)
        if old is None:
            self.run = None
            self._exact.add(image.digest, OldImage(index=self._images, path_px=path_px))
            self._near.add(image, self._images, stamp_ns, path_px)
        elif self.run is None:
            self.run = ReplayRun(since_ns=stamp_ns, last=old, exact=exact)
        else:
            self.run.count += 1
            self.run.distinct += 1
            self.run.last, self.run.exact = old, exact

    def _find_near(self, image: ImageSignature, before: ImageSignature, stamp_ns: int) -> OldImage | None:
        if self.run is not None and not self.run.exact:
            return self._near.follow(image, self.run.last)
        return self._near.enter(image, before, stamp_ns)
