"""Every attack by name, with its options and their units: the one table that parser and help share."""

from __future__ import annotations

from belie.attacks.kind import COMMON, RESTORE, AttackKind, Stream, delay_option
from belie.attacks.object_catalogue import detection_attacks, paper_object_attacks
from belie.attacks.option import Option

ROTATIONS = ("roll", "pitch", "yaw")
VEHICLE_AXES = ("forward", "left", "up")
_AXES: dict[Stream, tuple[str, ...]] = {
    "odometry": ("x", "y", "z", *VEHICLE_AXES, *ROTATIONS),
    "imu": ("x", "y", "z", *VEHICLE_AXES, *ROTATIONS),
    "position": ("x", "y", "z", *VEHICLE_AXES),
}
_UNIT: dict[Stream, str] = {
    "odometry": "m or deg",
    "imu": "deg/s or m/s²",
    "position": "m",
}


def _axis(stream: Stream, default: str | None, meaning: str = "which coordinate or direction") -> Option:
    return Option(
        name="axis",
        form="choice",
        choices=_AXES[stream],
        synonyms=(("lateral", "left"),),
        default=default,
        meaning=meaning,
    )


def _number(
    name: str, unit: str, meaning: str, *, above: float | None = None, least: float | None = None
) -> Option:
    return Option(
        name=name, form="number", unit=unit, meaning=meaning, required=True, above=above, least=least
    )


def _claim_attacks(stream: Stream) -> list[AttackKind]:
    unit = _UNIT[stream]
    usual = {"odometry": "left", "imu": "yaw", "position": "x"}[stream]
    turning = "x" if stream == "position" else "yaw"
    magnitude = Option(name="magnitude", form="number", unit=unit, meaning="constant offset")
    creep = Option(name="rate", form="number", unit=f"{unit}, a frame", meaning="growth instead of magnitude")
    bias_unit = unit if stream == "imu" else f"{unit}, a frame"
    everything = "all three directions of the motion (IMU: of the angular rate) if left out"
    table: list[tuple[str, str, tuple[Option, ...], str | None]] = [
        (
            "offset",
            "a constant error (magnitude), or one that grows with every frame (rate)",
            (_axis(stream, usual), magnitude, creep),
            None,
        ),
        (
            "ramp",
            "an error that grows with time",
            (_axis(stream, usual), _number("rate", f"{unit}, a second", "growth")),
            "rate",
        ),
        (
            "bias",
            "a biased rate, integrated as the sender would: a yaw bias bends the path",
            (_axis(stream, turning), _number("rate", bias_unit, "bias")),
            "rate",
        ),
        (
            "scale",
            "motion since the onset is multiplied",
            (_axis(stream, None, everything), _number("factor", "", "multiplier of the motion")),
            "factor",
        ),
        (
            "set",
            "one coordinate (or rate) is set to a constant",
            (_axis(stream, "x" if stream != "imu" else usual), _number("value", unit, "what it is set to")),
            "value",
        ),
        ("freeze", "the last honest value is repeated (the twist is zero)", (), None),
        ("replay", "values already sent are sent again, `delay` later", (delay_option(20),), "delay"),
        ("delay", "the stream stalls for `delay`, then runs that much late", (delay_option(5),), "delay"),
        (
            "sinusoid",
            "an error that swings",
            (
                _axis(stream, usual),
                _number("amplitude", unit, "of the swing"),
                _number("period", "s", "of one cycle", above=0.0),
            ),
            "amplitude",
        ),
        (
            "noise",
            "white Gaussian noise, drawn anew for every message",
            (_axis(stream, None, everything), _number("sigma", unit, "standard deviation", least=0.0)),
            "sigma",
        ),
        ("flip", "the motion along or about an axis changes its sign", (_axis(stream, turning),), None),
    ]
    extra = (RESTORE,) if stream == "odometry" else ()
    return [
        AttackKind(
            name=f"{stream}-{kind}",
            stream=stream,
            kind=kind,
            summary=summary,
            options=(*options, *COMMON, *extra),
            strength=strength,
        )
        for kind, summary, options, strength in table
    ]


def _camera_attacks() -> list[AttackKind]:
    grain = Option(
        name="noise",
        form="number",
        unit="gray levels",
        default=0.0,
        least=0.0,
        meaning="standard deviation of the sensor noise added to the false image",
    )
    level = Option(
        name="level", form="integer", unit="gray levels", default=0, least=0, most=255, meaning="brightness"
    )
    fraction = Option(
        name="fraction",
        form="number",
        default=0.85,
        above=0.0,
        most=1.0,
        meaning="share of the image covered",
    )
    texture = Option(
        name="texture",
        form="choice",
        choices=("plain", "cloth"),
        default="plain",
        meaning="a textureless occluder, or a textured one",
    )
    sigma = _number("sigma", "gray levels", "standard deviation", least=0.0)
    table: list[tuple[str, str, tuple[Option, ...], str | None]] = [
        ("freeze", "the last honest image is repeated, bit for bit", (grain,), None),
        (
            "replay",
            "images already sent are sent again, `delay` later, bit for bit",
            (delay_option(20),),
            "delay",
        ),
        ("delay", "the picture stalls for `delay`, then runs that much late", (delay_option(5),), "delay"),
        ("black", "one gray level everywhere", (level, grain), "level"),
        ("cover", "something stands before the lens", (fraction, texture, level, grain), "fraction"),
        ("noise", "white Gaussian noise on every pixel", (sigma,), "sigma"),
    ]
    return [
        AttackKind(
            name=f"camera-{kind}",
            stream="camera",
            kind=kind,
            summary=summary,
            options=(*options, *COMMON),
            strength=strength,
        )
        for kind, summary, options, strength in table
    ]


def _paper_attacks() -> list[AttackKind]:
    growth = Option(name="rate", form="number", unit="m, a frame", default=0.2, meaning="growth")
    value = Option(name="value", form="number", unit="m", default=1.0, meaning="what it is set to")
    return [
        AttackKind(
            name="paper-odometry",
            stream="odometry",
            kind="offset",
            summary="the paper's IV-B: +0.2 m a frame sideways for ten frames, then the true pose again",
            options=(_axis("odometry", "left"), growth, *COMMON, RESTORE),
            strength="rate",
            frames=10,
        ),
        AttackKind(
            name="paper-position",
            stream="position",
            kind="set",
            summary="the paper's IV-B: x is set to 1 for ten frames",
            options=(_axis("position", "x"), value, *COMMON),
            strength="value",
            frames=10,
        ),
    ]


ATTACKS: dict[str, AttackKind] = {
    entry.name: entry
    for entry in [
        *_paper_attacks(),
        *paper_object_attacks(),
        *_claim_attacks("odometry"),
        *_claim_attacks("imu"),
        *_claim_attacks("position"),
        *_camera_attacks(),
        *detection_attacks(),
    ]
}
