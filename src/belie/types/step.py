"""The unit of a recording: a frame and the claims that came with it."""

from __future__ import annotations

from dataclasses import dataclass

from belie.types.claims import Claim
from belie.types.frame import Frame


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Step:
    """One frame and every claim not yet handed out that is stamped up to it, and the first after it.

    The claim after the frame lets the detector interpolate at the frame's stamp. Claims come in order of
    their stamps; each claim is handed out once.
    """

    frame: Frame
    claims: tuple[Claim, ...] = ()
    decode_ms: float = 0.0
