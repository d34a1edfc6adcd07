"""What an attack is called and takes: the row of the catalogue, and the options that all attacks share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from belie.attacks.option import Option
from belie.attacks.timing import Timing

Stream = Literal["odometry", "imu", "position", "camera", "detections"]


@dataclass(frozen=True, slots=True, kw_only=True)
class AttackKind:
    """One named attack.

    Parameters
    ----------
    name, stream, kind : str
        ``odometry-offset`` is the kind ``offset`` on the stream ``odometry``.
    summary : str
        One line for the user.
    options : tuple of Option
        In the order in which they are printed.
    strength : str or None
        The option that ``magnitude`` stands for.
    frames : int or None
        How many frames it lasts where no stop is given; None: to the end.

    Examples
    --------
    >>> hide = AttackKind(name="paper-hiding", stream="detections", kind="hide", summary="", options=COMMON, frames=10)
    >>> [option.name for option in hide.options]
    ['start', 'stop', 'source', 'seed']
    """

    name: str
    stream: Stream
    kind: str
    summary: str
    options: tuple[Option, ...]
    strength: str | None = None
    frames: int | None = None


_START = Option(
    name="start",
    form="timing",
    unit="frame, or s",
    default=Timing(value=100, unit="frame"),
    meaning="first attacked frame",
)
_STOP = Option(
    name="stop",
    form="timing",
    unit="frame, or s",
    meaning="first honest frame again; end of the recording if left out",
)
_SOURCE = Option(name="source", form="text", meaning="topic to attack; all of this stream if left out")
_SEED = Option(name="seed", form="integer", default=0, least=0, meaning="of everything random")
COMMON = (_START, _STOP, _SOURCE, _SEED)
RESTORE = Option(
    name="restore",
    form="flag",
    default=True,
    meaning="true: the true pose returns at stop; false: the error stays and increments are honest again",
)
OBJECT = Option(
    name="object",
    form="text",
    meaning="track id to attack; if left out the largest object that stays until the attack ends; if none does, in "
    "a closed loop and live, where nobody knows what will stay: the largest that has been held for a second",
)


def delay_option(frames: int) -> Option:
    """How old what is sent is; `frames` by default.

    >>> str(delay_option(5).default)
    '5'
    """
    return Option(
        name="delay",
        form="timing",
        unit="frames, or s",
        default=Timing(value=frames, unit="frame"),
        above=0.0,
        meaning="age of the content that is sent",
    )
