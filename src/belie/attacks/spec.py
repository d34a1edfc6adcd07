"""The value that names an attack, and its text: ``odometry-offset:axis=y,rate=0.2,start=100,stop=110``."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from belie.attacks.catalogue import ATTACKS
from belie.attacks.kind import AttackKind, Stream
from belie.attacks.object_catalogue import BOX
from belie.attacks.option import Option, OptionValue
from belie.attacks.timing import FrameClock, Span, Timing
from belie.types import AttackError


@dataclass(frozen=True, slots=True, kw_only=True)
class AttackSpec:
    """One attack and all its options, in the units of its text (degrees); made by `parse_attack` or `of`.

    Examples
    --------
    >>> spec = AttackSpec.of("odometry-bias", rate=0.05, start=40)
    >>> spec.stream, spec.kind, spec["rate"], spec.to_text()
    ('odometry', 'bias', 0.05, 'odometry-bias:rate=0.05,start=40')
    >>> parse_attack(spec.to_text()) == AttackSpec.from_dict(spec.to_dict()) == spec
    True
    """

    name: str
    options: tuple[tuple[str, OptionValue], ...]

    @classmethod
    def of(cls, name: str, **options: OptionValue) -> AttackSpec:
        """An attack from its name and options; what is left out (or None) takes its default.

        Raises
        ------
        AttackError
            On an unknown name or option, a value that makes no sense, or a missing one.
        """
        given = {key: str(value) for key, value in options.items() if value is not None}
        return _read(name, given)

    @classmethod
    def from_dict(cls, entries: Mapping[str, object]) -> AttackSpec:
        """The inverse of `to_dict`; raises `AttackError` like `of`."""
        given = {key: str(value) for key, value in entries.items() if key != "name" and value is not None}
        return _read(str(entries.get("name", "")), given)

    def to_dict(self) -> dict[str, float | int | str | bool]:
        """Name and options that differ from their defaults, fit for JSON."""
        given: dict[str, float | int | str | bool] = {"name": self.name}
        for option in self.entry.options:
            value = self[option.name]
            if value is not None and value != option.default:
                given[option.name] = str(value) if isinstance(value, Timing) else value
        return given

    def to_text(self) -> str:
        """The text that `parse_attack` reads back."""
        given = {key: _plain(value) for key, value in self.to_dict().items() if key != "name"}
        return ":".join([self.name, *([",".join(f"{k}={v}" for k, v in given.items())] if given else [])])

    @property
    def entry(self) -> AttackKind:
        """The catalogue's entry."""
        return ATTACKS[self.name]

    @property
    def stream(self) -> Stream:
        """Which stream lies."""
        return self.entry.stream

    @property
    def kind(self) -> str:
        """How it lies."""
        return self.entry.kind

    @property
    def axis(self) -> str | None:
        """Along or about which axis; None for all, or where the attack has none."""
        value = dict(self.options).get("axis")
        return None if value is None else str(value)

    def __getitem__(self, option: str) -> OptionValue:
        return dict(self.options)[option]

    def number(self, option: str) -> float:
        """A numeric option, in the unit of the text; `KeyError` where the attack has none of that name."""
        value = self[option]
        if not isinstance(value, int | float):
            raise KeyError(option)
        return float(value)

    def timing(self, option: str) -> Timing:
        """An option that is frames or seconds; `KeyError` where the attack has none of that name."""
        value = self[option]
        if not isinstance(value, Timing):
            raise KeyError(option)
        return value

    def span(self, clock: FrameClock) -> Span:
        """Frames and stamps in which this attack acts on a recording.

        Raises
        ------
        AttackError
            Where it would start after the last frame, stop before it starts, or reach back before the
            first frame (replay, delay).
        """
        start = clock.frame_number(self.timing("start"))
        if start >= len(clock):
            raise AttackError(
                f"{self.to_text()} starts at frame {start}, but the recording has {len(clock)} frames: "
                f"set start below {len(clock)}"
            )
        stop = len(clock)
        if self["stop"] is not None:
            stop = min(stop, clock.frame_number(self.timing("stop")))
        elif self.entry.frames is not None:
            stop = min(stop, start + self.entry.frames)
        if stop <= start:
            raise AttackError(f"{self.to_text()} stops at frame {stop}, not after its start at {start}")
        span = Span(
            start_frame=start,
            stop_frame=stop,
            start_ns=int(clock.stamps_ns[start]),
            end_ns=int(clock.stamps_ns[stop]) if stop < len(clock) else None,
        )
        if self.kind == "replay" and clock.before(span.start_ns, self.timing("delay")) < clock.stamps_ns[0]:
            raise AttackError(
                f"{self.to_text()} would replay what was never recorded: start or shorten "
                f"delay={self['delay']} so that it reaches back no further than the first frame"
            )
        return span


def parse_attack(text: str) -> AttackSpec:
    """Read ``name:option=value,option=value``.

    Raises
    ------
    AttackError
        On an unknown name or option (with what is known), a value that makes no sense, or a missing one.

    Examples
    --------
    >>> parse_attack("odometry-offset:axis=y,rate=0.2,start=100,stop=110").kind
    'offset'
    >>> parse_attack("odometry-ofset")
    Traceback (most recent call last):
    ...
    belie.types.errors.AttackError: unknown attack 'odometry-ofset'; did you mean 'odometry-offset'? Known: \
odometry-offset, odometry-ramp, odometry-bias, odometry-scale, odometry-set, odometry-freeze, \
odometry-replay, odometry-delay, odometry-sinusoid, odometry-noise, odometry-flip, paper-odometry
    """
    name, colon, tail = text.strip().partition(":")
    given: dict[str, str] = {}
    for part in tail.split(",") if colon else []:
        key, equals, value = part.partition("=")
        key = key.strip()
        if not (key and equals and value.strip()):
            raise AttackError(f"{text!r}: expected option=value, got {part!r}")
        if "=" in value:
            raise AttackError(f"{text!r}: {part!r} has more than one '='; options are set apart by commas")
        if key in given:
            raise AttackError(f"{text!r} gives {key} twice")
        given[key] = value
    return _read(name.strip(), given)


def _read(name: str, given: Mapping[str, str]) -> AttackSpec:
    entry = ATTACKS.get(name)
    if entry is None:
        stream, _, _ = name.partition("-")
        family = [known for known in ATTACKS if known.startswith(f"{stream}-") and stream != "paper"]
        if family and f"paper-{stream}" in ATTACKS:
            family.append(f"paper-{stream}")
        raise AttackError(
            f"unknown attack {name!r}{_suggest(name, ATTACKS)} Known: {', '.join(family or ATTACKS)}"
        )
    options = {option.name: option for option in entry.options}
    values: dict[str, OptionValue] = {option.name: option.default for option in entry.options}
    for key, text in given.items():
        # The issue gives every attack a magnitude; each kind calls its own by the field's name.
        target = entry.strength if key == "magnitude" and key not in options else key
        if target is None or target not in options:
            raise AttackError(
                f"{name} has no option {key!r}{_suggest(key, options)} Known: {', '.join(options)}"
            )
        if target != key and target in given:
            raise AttackError(f"{name}: magnitude means {target} here; give one of them")
        try:
            values[target] = options[target].read(text)
        except AttackError as error:
            raise AttackError(f"{name}: {error}") from None
    _check_complete(entry, options.values(), values)
    return AttackSpec(name=name, options=tuple(values.items()))


def _check_complete(entry: AttackKind, options: Iterable[Option], values: Mapping[str, OptionValue]) -> None:
    missing = [option for option in options if option.required and values[option.name] is None]
    if missing:
        wanted = ", ".join(f"{o.name}{f' [{o.unit}]' if o.unit else ''}" for o in missing)
        raise AttackError(f"{entry.name} needs {wanted}")
    if "magnitude" in values and (values["magnitude"] is None) == (values["rate"] is None):
        raise AttackError(f"{entry.name} needs either magnitude (constant) or rate (growth a frame)")
    if values.get("other") is not None and values["other"] == values.get("object"):
        raise AttackError(f"{entry.name} needs two objects: object and other are both {values['other']}")
    box = [values[name] is None for name in BOX if name in values]
    if any(box) and not all(box):
        raise AttackError(f"{entry.name} needs all of {', '.join(BOX)} [px], or none of them")


def _suggest(word: str, known: Iterable[str]) -> str:
    close = difflib.get_close_matches(word, list(known), n=1)
    return f"; did you mean {close[0]!r}?" if close else "."


def _plain(value: float | int | str | bool) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value).removesuffix(".0") if isinstance(value, float) else str(value)
