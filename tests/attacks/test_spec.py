"""The text of an attack: what is read, what is refused, and how it is told."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

import belie.attacks
from belie.attacks import AttackSpec, describe_attacks, parse_attack
from belie.attacks.catalogue import ATTACKS
from belie.types import AttackError

CLAIM_KINDS = [
    "offset",
    "ramp",
    "bias",
    "scale",
    "set",
    "freeze",
    "replay",
    "delay",
    "sinusoid",
    "noise",
    "flip",
]
CAMERA_KINDS = ["freeze", "replay", "delay", "black", "cover", "noise"]
OBJECT_KINDS = ["hide", "relabel", "shift", "shrink", "phantom", "swap", "delay", "patch"]


def test_public_api():
    assert belie.attacks.__all__ == [
        "AttackLabel",
        "AttackSpec",
        "AttackedRecording",
        "Choice",
        "FrameClock",
        "RunningAttack",
        "Source",
        "StayingObject",
        "Timing",
        "attack",
        "attacked_streams",
        "choose_objects",
        "describe_attacks",
        "labels_path",
        "parse_attack",
        "read_labels",
        "staying_objects",
        "write_labels",
    ]
    assert all(hasattr(belie.attacks, name) for name in belie.attacks.__all__)


def test_every_kind_exists_on_every_stream():
    names = {f"{stream}-{kind}" for stream in ("odometry", "imu", "position") for kind in CLAIM_KINDS}
    names |= {f"camera-{kind}" for kind in CAMERA_KINDS} | {"paper-odometry", "paper-position"}
    names |= {f"detections-{kind}" for kind in OBJECT_KINDS} | {"paper-hiding", "paper-misclassification"}
    assert set(ATTACKS) == names
    assert all(name in describe_attacks() for name in names)


def test_the_designs_example():
    spec = parse_attack("odometry-offset:axis=y,rate=0.2,start=100,stop=110")
    assert (spec.stream, spec.kind, spec.axis, spec["rate"]) == ("odometry", "offset", "y", 0.2)
    assert (str(spec["start"]), str(spec["stop"])) == ("100", "110")


def test_units_names_and_aliases():
    assert parse_attack("position-ramp:rate=0.5,axis=lateral").axis == "left"
    assert parse_attack("imu-bias:magnitude=0.5")["rate"] == 0.5
    assert parse_attack("paper-odometry:magnitude=-0.3")["rate"] == -0.3
    assert str(parse_attack("camera-black:start=10.5s")["start"]) == "10.5s"
    assert parse_attack("odometry-offset:rate=1,restore=False")["restore"] is False


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("odometry-ofset", "did you mean 'odometry-offset'"),
        ("lidar-freeze", "Known: paper-odometry"),
        ("camera-ramp:rate=1", "Known: camera-freeze"),
        ("", "unknown attack ''"),
        ("odometry-offset:rat=0.2", "did you mean 'rate'"),
        ("odometry-offset", "either magnitude"),
        ("odometry-offset:rate=1,magnitude=1", "either magnitude"),
        ("odometry-ramp", "needs rate [m or deg, a second]"),
        ("odometry-sinusoid:amplitude=1", "needs period [s]"),
        ("odometry-sinusoid:amplitude=1,period=0", "> 0"),
        ("odometry-offset:rate=fast", "expected a number"),
        ("odometry-offset:rate=nan", "expected a number"),
        ("odometry-offset:rate=inf", "expected a number"),
        ("odometry-offset:rate=1,rate=2", "twice"),
        ("odometry-offset:rate", "option=value"),
        ("odometry-offset:rate=", "option=value"),
        ("odometry-offset:rate=1,", "option=value"),
        ("odometry-offset:rate=1,start=-3", "frames (100) or seconds (10.5s)"),
        ("odometry-offset:rate=1,start=1.5", "frames (100) or seconds (10.5s)"),
        (
            "odometry-offset:rate=1,axis=sideways",
            "one of x, y, z, forward, left, up, roll, pitch, yaw, lateral",
        ),
        ("position-offset:magnitude=1,axis=yaw", "one of x, y, z, forward, left, up, lateral"),
        ("position-offset:magnitude=1,restore=false", "no option 'restore'"),
        ("odometry-offset:rate=1,restore=perhaps", "true or false"),
        ("camera-cover:fraction=1.5", "<= 1"),
        ("camera-freeze:magnitude=1", "no option 'magnitude'"),
        ("camera-black:level=300", "<= 255"),
        ("imu-noise:sigma=-1", ">= 0"),
        ("imu-bias:rate=1,magnitude=2", "magnitude means rate"),
        ("imu-delay:delay=0", "> 0"),
        ("imu-flip:seed=-1", ">= 0"),
        ("detections-vanish", "Known: detections-hide"),
        ("detections-phantom:x=3,y=4,w=10", "needs all of x, y, w, h [px], or none"),
        ("detections-phantom:object=7", "no option 'object'"),
        ("detections-patch:rate=1.2", "<= 1"),
        ("detections-patch:mode=shine", "one of hide, relabel"),
        ("detections-shrink:factor=0", "> 0"),
    ],
)
def test_nonsense_is_refused_in_one_line(text, says):
    with pytest.raises(AttackError) as caught:
        parse_attack(text)
    message = str(caught.value)
    assert says in message
    assert "\n" not in message


def test_only_what_differs_from_the_defaults_is_told():
    assert parse_attack("paper-odometry:axis=left,rate=0.2,start=100").to_text() == "paper-odometry"
    assert AttackSpec.of("odometry-noise", sigma=0.1, restore=False).to_dict() == {
        "name": "odometry-noise",
        "sigma": 0.1,
        "restore": False,
    }


@given(
    rate=st.floats(allow_nan=False, allow_infinity=False),
    start=st.integers(0, 10**6),
    stop_s=st.floats(0.0, 1e6),
    axis=st.sampled_from(["x", "up", "yaw"]),
    seed=st.integers(0, 2**63),
)
def test_text_and_dict_round_trip(rate, start, stop_s, axis, seed):
    spec = AttackSpec.of(
        "odometry-ramp", rate=rate, start=start, stop=f"{stop_s!r}s", axis=axis, seed=seed, source="/a/odom"
    )
    assert parse_attack(spec.to_text()) == spec
    assert AttackSpec.from_dict(spec.to_dict()) == spec
    assert hash(parse_attack(spec.to_text())) == hash(spec)


def test_a_colon_between_options_is_no_part_of_a_name():
    with pytest.raises(AttackError, match="more than one '='; options are set apart by commas"):
        parse_attack("detections-hide:object=6:start=80")
