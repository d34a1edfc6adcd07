"""The attacks on what a detector claims to see, by name: part of the catalogue."""

from __future__ import annotations

from belie.attacks.kind import COMMON, OBJECT, AttackKind, delay_option
from belie.attacks.option import Option

BOX = ("x", "y", "w", "h")
_BIRD = Option(name="to", form="text", default="bird", meaning="label that the object is given")
_FRAMES_OF_THE_PAPER = 10
_UNSEEN = "belie checks no box's size or place as long as it overlaps its object by an IoU of 0.25"


def detection_attacks() -> list[AttackKind]:
    """``detections-KIND``, in the order in which they are printed.

    >>> [attack.kind for attack in detection_attacks()]
    ['hide', 'relabel', 'shift', 'shrink', 'phantom', 'swap', 'delay', 'patch']
    """
    dx = Option(name="dx", form="number", unit="box widths", default=1.0, meaning="to the right")
    dy = Option(name="dy", form="number", unit="box heights", default=0.0, meaning="down")
    factor = Option(
        name="factor", form="number", default=0.5, above=0.0, most=1.0, meaning="multiplier of every side"
    )
    other = Option(
        name="other",
        form="text",
        meaning="track id to swap with; if left out the next largest, chosen as the first",
    )
    mode = Option(
        name="mode", form="choice", choices=("hide", "relabel"), default="hide", meaning="what the patch does"
    )
    rate = Option(
        name="rate",
        form="number",
        default=0.9,
        above=0.0,
        most=1.0,
        meaning="probability per message that the detector is fooled",
    )
    table: list[tuple[str, str, tuple[Option, ...], str | None]] = [
        (
            "hide",
            "one object is left out of the message. belie does not miss one of which less than 70 % is inside the "
            "image",
            (),
            None,
        ),
        (
            "relabel",
            "one object gets another label; box, position and id stay. belie does not contradict a label of the same "
            "group (car, van, truck)",
            (_BIRD,),
            None,
        ),
        (
            "shift",
            f"one box is moved, its position with it at the same depth; out of the image it is left out. {_UNSEEN} (a "
            "shift of 0.6 widths)",
            (dx, dy),
            "dx",
        ),
        (
            "shrink",
            f"one object shrinks about its middle: box and dimensions, not its position. {_UNSEEN} (a factor of 0.5)",
            (factor,),
            "factor",
        ),
        (
            "phantom",
            "an object that is not there, score 0.9, under one new id: on the road ahead, or at a box (left, top, "
            "width, height); it keeps its place in the image, or approaches and grows",
            _phantom_options(),
            None,
        ),
        (
            "swap",
            "two objects exchange their track ids. belie sees it only where they are farther apart (middle to middle) "
            "than the sum of their longer sides",
            (other,),
            None,
        ),
        (
            "delay",
            "all objects (one, if object is given) stall for `delay`, then run that much late under new stamps. "
            f"{_UNSEEN} (objects that are slow in the image)",
            (delay_option(5),),
            "delay",
        ),
        (
            "patch",
            "an adversarial patch on one object, as the simulated detector is fooled by it: each message anew it is "
            "left out, or relabelled",
            (mode, _BIRD, rate),
            "rate",
        ),
    ]
    return [
        AttackKind(
            name=f"detections-{kind}",
            stream="detections",
            kind=kind,
            summary=summary,
            options=(*options, *COMMON) if kind == "phantom" else (*options, OBJECT, *COMMON),
            strength=strength,
        )
        for kind, summary, options, strength in table
    ]


def _phantom_options() -> tuple[Option, ...]:
    label = Option(name="label", form="text", default="car", meaning="its class")
    distance = Option(
        name="distance", form="number", unit="m", default=20.0, above=0.0, meaning="ahead of the camera"
    )
    right = Option(name="right", form="number", unit="m", default=0.0, meaning="sideways")
    edges = [
        Option(name=name, form="number", unit="px", meaning=meaning, above=above)
        for name, meaning, above in zip(
            BOX, ("left edge", "top edge", "width", "height"), (None, None, 0.0, 0.0), strict=True
        )
    ]
    motion = Option(
        name="motion",
        form="choice",
        choices=("still", "approach"),
        default="still",
        meaning="keep its place in the image, or come closer",
    )
    speed = Option(name="speed", form="number", unit="m/s", default=5.0, least=0.0, meaning="of the approach")
    return (label, distance, right, *edges, motion, speed)


def paper_object_attacks() -> list[AttackKind]:
    """The paper's attacks on objects, ten frames from frame 100.

    >>> [(attack.name, attack.kind, attack.frames) for attack in paper_object_attacks()]
    [('paper-hiding', 'hide', 10), ('paper-misclassification', 'relabel', 10)]
    """
    return [
        AttackKind(
            name="paper-hiding",
            stream="detections",
            kind="hide",
            summary="the paper's IV-B: an obstacle disappears for ten frames. The paper shifts its box far away; here "
            "it is left out, which comes to the same",
            options=(OBJECT, *COMMON),
            frames=_FRAMES_OF_THE_PAPER,
        ),
        AttackKind(
            name="paper-misclassification",
            stream="detections",
            kind="relabel",
            summary="the paper's IV-B: an obstacle (there a car) is called a bird for ten frames",
            options=(_BIRD, OBJECT, *COMMON),
            frames=_FRAMES_OF_THE_PAPER,
        ),
    ]
