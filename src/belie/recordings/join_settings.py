"""How long the joining of streams waits, and what it refuses."""

from __future__ import annotations

from pydantic import Field

from belie.types import Settings


class JoinSettings(Settings):
    """How long the joining of streams waits.

    >>> JoinSettings().reorder_window_ms
    200.0
    """

    reorder_window_ms: float = Field(
        200.0, description="[ms] receive time for which a frame waits for late claims and frames", ge=0.0
    )
    patience_ms: float = Field(
        1500.0,
        description="[ms] receive time for which a frame waits for a slow stream's next claim",
        ge=0.0,
    )
    clock_jump_s: float = Field(
        1.0, description="[s] a claim stamped further back than this counts as a clock jump", gt=0.0
    )
    max_clock_offset_s: float = Field(
        60.0,
        description="[s] a stream whose clock is further from the images' than this is refused",
        gt=0.0,
    )
    max_waiting_frames: int = Field(
        48, description="[1] frames held back at most, so that memory stays bounded", ge=1
    )
    max_waiting_claims: int = Field(
        100_000, description="[1] claims of one stream held back at most before its clock is refused", ge=1
    )
