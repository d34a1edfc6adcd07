"""Settings of the object checks."""

from __future__ import annotations

from pydantic import Field

from belie.checks.objects.class_groups import ClassGroups
from belie.types import Settings


class ObjectSettings(Settings):
    """Objects: hiding, misclassification, injection.

    >>> ObjectSettings().corners
    24
    """

    corners: int = Field(24, ge=8, le=64, description="corners followed on each object [count]")
    most_objects: int = Field(
        64, ge=1, le=500, description="objects followed at once, the largest first [count]"
    )
    least_side_px: float = Field(
        24.0, ge=8.0, description="an object whose longer side is shorter is too small to judge [px]"
    )
    established: float = Field(
        6.0, gt=0.0,
        description="weight of an object's detections before its absence or another label means anything [count]: a "
        "detection of score 0.9 weighs 2, one of 0.45 a half, and half of that at 24 px instead of 48; what a detector "
        "imagines is short and unsure, and what is far is mixed up with what stands before it",
    )  # fmt: skip
    miss_rate: float = Field(
        0.03, gt=0.0, lt=1.0,
        description="share of messages in which a detector misses a clearly visible object, before this stream has "
        "shown its own [1]; strong detectors have 0.01 to 0.05",
    )  # fmt: skip
    confusion_rate: float = Field(
        0.01, gt=0.0, lt=1.0,
        description="share of messages with a label of another group, before this stream has shown its own [1]",
    )  # fmt: skip
    persistence_s: float = Field(
        0.02, gt=0.0,
        description="time for which consecutive images share the cause of a miss (noise, blur), before this stream "
        "has shown its own gaps [s]",
    )  # fmt: skip
    prior_messages: float = Field(
        40.0,
        gt=0.0,
        description="messages about objects after which what a stream shows counts as much as the rates above [count]",
    )
    prior_gaps: float = Field(
        10.0,
        gt=0.0,
        description="misses after which what a stream shows counts as much as the persistence above [count]",
    )
    object_messages: float = Field(
        20.0, gt=0.0,
        description="messages about one object after which its own share of errors counts as much as its stream's "
        "[count]; larger: what one object shows counts for less",
    )  # fmt: skip
    object_gaps: float = Field(
        5.0, gt=0.0,
        description="misses of one object after which how they lasted counts as much as in its stream [count]; "
        "larger: what one object shows counts for less",
    )  # fmt: skip
    half_seen_px: float = Field(
        20.0, gt=0.0,
        description="root of an object's area at which every second miss goes on into the next message [px]: what is "
        "hard to see because it is small stays so; detectors lose half of the objects at 15 to 20 px",
    )  # fmt: skip
    least_present: float = Field(
        0.5, gt=0.0, le=1.0,
        description="share of an object's corners that must still be found, and move as one, to say that it is "
        "there [1]",
    )  # fmt: skip
    least_contrast: float = Field(
        0.6, gt=0.0, le=1.0,
        description="contrast of its pixels, relative to when it was last detected, below which a detector may "
        "fairly lose it [1]: fog, shadow, dazzle",
    )  # fmt: skip
    least_in_view: float = Field(
        0.7,
        gt=0.0,
        le=1.0,
        description="share of its box inside the image below which it is leaving the view [1]",
    )
    most_covered: float = Field(
        0.4, gt=0.0, le=1.0,
        description="share of its box that another detection covers above which it may be occluded or merged [1]",
    )  # fmt: skip
    classes: ClassGroups = ClassGroups()
