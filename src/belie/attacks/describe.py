"""The catalogue as text, for the command line's help."""

from __future__ import annotations

from belie.attacks.catalogue import ATTACKS
from belie.attacks.kind import COMMON, OBJECT, RESTORE, AttackKind
from belie.attacks.option import Option

_INTRODUCTION = """\
SPEC is name:option=value,option=value; several compose, the first acts first.

axis    x, y, z: the coordinates the claim is written in (IMU: of the angular rate);
        forward, left (or lateral), up: the vehicle's own at the onset (IMU: of the acceleration);
        roll, pitch, yaw: turns about forward, left, up, in degrees.
        [axis] may be left out: all three directions.
*       the option that `magnitude` stands for; offset takes either magnitude or rate."""

_SHARED = (*COMMON, RESTORE, OBJECT)
# Streams whose kinds do what no other stream's kind of the same name does.
_OWN_MEANING = ("camera", "detections")


def describe_attacks() -> str:
    """The table of attacks, their options, units and defaults, as plain text.

    >>> print(describe_attacks().splitlines()[0])
    SPEC is name:option=value,option=value; several compose, the first acts first.
    """
    lines = [_INTRODUCTION, "", "Options of every attack (restore: of odometry; object: of detections)"]
    lines += [f"  {_usage(option, None):<34} {option.meaning}" for option in _SHARED]
    lines += ["", "Attacks"]
    for attack in ATTACKS.values():
        own = [option for option in attack.options if option not in _SHARED]
        usages = " ".join(_usage(option, attack.strength) for option in own)
        lines.append(f"  {attack.name:<24} {usages}".rstrip())
    lines += ["", "What they do"]
    lines += [f"  {name:<24} {attack.summary}" for name, attack in _by_meaning().items()]
    return "\n".join(lines)


def _by_meaning() -> dict[str, AttackKind]:
    """One attack for every kind: claims share theirs."""
    named: dict[str, AttackKind] = {}
    for attack in ATTACKS.values():
        shared = attack.stream not in _OWN_MEANING and not attack.name.startswith("paper")
        named.setdefault(f"…-{attack.kind}" if shared else attack.name, attack)
    return named


def _usage(option: Option, strength: str | None) -> str:
    mark = "*" if option.name == strength else ""
    if option.default is None:
        value = f"=<{option.unit}>" if option.unit else ""
        return f"{option.name}{mark}{value}" if option.required or value else f"[{option.name}]"
    default = str(option.default).lower().removesuffix(".0")
    others = [choice for choice in option.choices if choice != option.default and option.name != "axis"]
    unit = f" [{option.unit}]" if option.unit else ""
    return f"{option.name}{mark}={'|'.join([default, *others])}{unit}"
