"""Everything belie raises for bad input, and nothing else.

::

    BelieError                 one clear line: what was found and how to mend it
    ├── RecordingError         a file or folder that cannot be read
    │   ├── TopicError         a topic is missing or of the wrong type
    │   │   └── AmbiguousTopicError   several topics would do
    │   └── CalibrationError   intrinsics or an extrinsic transform are missing or wrong
    ├── ConfigError            a setting is unknown or out of range
    ├── AttackError            an attack specification that makes no sense
    ├── TransportError         a middleware that cannot be reached or refuses
    └── MissingExtraError      an optional dependency; the message holds the pip line

A misuse of the API raises `ValueError`. Weak evidence is no error: it is the status UNDECIDED.
"""

from __future__ import annotations


class BelieError(Exception):
    """Root of belie's errors; its text is one line, fit to be shown to a user."""


class RecordingError(BelieError):
    """A recording cannot be read as it stands."""


class TopicError(RecordingError):
    """A topic is missing, ambiguous or of an unexpected type."""


class AmbiguousTopicError(TopicError):
    """Several topics could play a part; waiting for more of them does not help."""


class CalibrationError(RecordingError):
    """Camera intrinsics or an extrinsic transform are missing or unusable."""


class ConfigError(BelieError):
    """A setting is unknown, misspelt or out of range.

    Attributes
    ----------
    in_words : str
        What the command line says: as the error's text, but of an unknown setting which known one may be meant.
    """

    def __init__(self, text: str, *, in_words: str = "") -> None:
        super().__init__(text)
        self.in_words = in_words or text


class AttackError(BelieError):
    """An attack specification names an unknown attack, stream, option or span."""


class TransportError(BelieError):
    """A middleware (DDS, Zenoh, ROS 1, MQTT) cannot be reached or refuses what is asked of it."""


class MissingExtraError(BelieError):
    """An optional dependency is not installed."""

    def __init__(self, package: str, extra: str) -> None:
        super().__init__(f"{package} is not installed; run: pip install 'belie[{extra}]'")
