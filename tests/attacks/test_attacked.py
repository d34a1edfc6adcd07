"""Properties of every attack: nothing outside its span, the same bytes twice, the source unchanged."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from belie.attacks import AttackSpec, attack
from belie.attacks.catalogue import ATTACKS
from belie.types import AlertType, AttackError, DetectionClaim, MotionClaim, PoseClaim, PositionClaim, Step

FRAMES = 30


@st.composite
def specs(draw):
    """Any attack with any options that make sense on 30 frames."""
    entry = ATTACKS[draw(st.sampled_from(sorted(ATTACKS)))]
    start = draw(st.integers(5, FRAMES - 2))
    options = {"start": start, "stop": draw(st.one_of(st.none(), st.integers(start + 1, FRAMES + 5)))}
    number = st.floats(-50, 50).filter(lambda x: abs(x) > 1e-3)
    for option in entry.options:
        match option.name:
            case "axis":
                optional = option.default is None
                axes = st.sampled_from([*option.choices, "lateral"])
                if entry.stream == "position":
                    axes = st.sampled_from(option.choices)
                options["axis"] = draw(st.one_of(st.none(), axes) if optional else axes)
            case "rate" | "factor" if entry.stream == "detections":
                options[option.name] = 1.0 if entry.kind == "patch" else draw(st.floats(0.1, 0.9))
            case "x" | "y" | "w" | "h":
                # The camera of this recording sees no road.
                options[option.name] = draw(st.floats(0.5, 10.0))
            case "to" | "label":
                options[option.name] = draw(st.uuids().map(str))
            case "motion" | "mode":
                options[option.name] = draw(st.sampled_from(option.choices))
            case "dx" | "dy":
                options[option.name] = draw(st.floats(-2.0, 2.0))
            case "rate" | "factor" | "value" | "amplitude":
                options[option.name] = draw(number)
            case "sigma" | "noise":
                options[option.name] = draw(st.floats(0.0, 10.0))
            case "period":
                options["period"] = draw(st.floats(0.05, 10.0))
            case "delay":
                options["delay"] = draw(st.one_of(st.integers(1, 5), st.just("0.35s")))
            case "seed":
                options["seed"] = draw(st.integers(0, 2**32))
            case "fraction":
                options["fraction"] = draw(st.floats(0.1, 1.0))
            case "texture":
                options["texture"] = draw(st.sampled_from(option.choices))
    if "magnitude" in {option.name for option in entry.options} and draw(st.booleans()):
        options["magnitude"] = options.pop("rate")
    return AttackSpec.of(entry.name, **options)


@settings(max_examples=60, deadline=None)
@given(spec=specs(), axes=st.sampled_from(["flu", "rdf"]))
def test_every_attack_keeps_to_its_stream_and_span(curve, bits, spec, axes):
    # A world of rdf axes has no level ground to find a course on: the odometry gives the heading.
    source = curve(body_axes=axes, position_frame="enu" if axes == "flu" else "odom")
    before = bits(list(source.steps()))
    attacked = attack(source, spec)
    out = list(attacked.steps())
    label = attacked.labels[0]
    end_ns = label.end_ns if label.stop_frame < FRAMES else 2**63
    for old, new in zip(source.steps(), out, strict=True):
        inside = label.start_ns <= old.frame.stamp_ns < end_ns
        if not (inside and spec.stream == "camera"):
            assert bits(old.frame) == bits(new.frame)
        for a, b in zip(old.claims, new.claims, strict=True):
            roles = {PoseClaim: "odometry", PositionClaim: "position", DetectionClaim: "detections"}
            role = roles.get(type(a))
            role = role or ("imu" if isinstance(a, MotionClaim) and a.kind == "imu" else "odometry")
            assert (type(a), a.source, a.stamp_ns, a.received_ns) == (
                type(b),
                b.source,
                b.stamp_ns,
                b.received_ns,
            )
            if role != spec.stream or not label.start_ns <= a.stamp_ns < end_ns:
                assert a is b or bits(a) == bits(b)
            if isinstance(b, PoseClaim):
                R = b.T_odom_body.R
                assert np.abs(R @ R.T - np.eye(3)).max() < 1e-9
                assert np.linalg.det(R) == pytest.approx(1.0)
    assert bits(out) == bits(list(attacked.steps())) == bits(list(attack(source, spec).steps()))
    assert bits(list(source.steps())) == before


@settings(max_examples=12, deadline=None)
@given(first=specs(), second=specs(), third=specs())
def test_attacks_compose_in_order(curve, bits, first, second, third):
    source = curve()
    together = attack(source, [first, second, third])
    nested = attack(attack(attack(source, first), [second]), third)
    assert bits(list(together.steps())) == bits(list(nested.steps()))
    assert together.labels == nested.labels


def test_order_matters(curve, claims_of):
    offset, scale = "position-offset:magnitude=10,start=8", "position-scale:factor=2,axis=x,start=10"
    true = np.array([claim.position_m[0] for claim in claims_of(curve(), PositionClaim)])
    x = {
        order: np.array([claim.position_m[0] for claim in claims_of(attack(curve(), order), PositionClaim)])
        for order in [(offset, scale), (scale, offset)]
    }
    # Scaling acts on the motion since its onset: an offset that stood before it is not motion.
    assert x[offset, scale][12] == pytest.approx(true[9] + 10 + 2 * (true[12] - true[9]))
    late = "position-offset:magnitude=10,start=12"
    scaled_last = claims_of(attack(curve(), [late, scale]), PositionClaim)[12].position_m[0]
    scaled_first = claims_of(attack(curve(), [scale, late]), PositionClaim)[12].position_m[0]
    assert scaled_last - scaled_first == pytest.approx(10.0)


def test_seeds_and_sources_have_their_own_noise(curve, bits):
    def run(seed):
        return bits(list(attack(curve(), f"imu-noise:sigma=1,start=5,seed={seed}").steps()))

    assert run(1) == run(1)
    assert run(1) != run(2)


def test_two_odometries(curve):
    class Two:
        """Every odometry claim a second time, as /wheel."""

        def __init__(self, source):
            self.cameras, self.body_axes = source.cameras, source.body_axes
            self.frame_stamps_ns, self._source = source.frame_stamps_ns, source

        def steps(self):
            for step in self._source.steps():
                wheel = tuple(
                    PoseClaim(
                        source="/wheel",
                        frame_id="odom",
                        stamp_ns=claim.stamp_ns,
                        received_ns=claim.received_ns,
                        T_odom_body=claim.T_odom_body,
                    )
                    for claim in step.claims
                    if isinstance(claim, PoseClaim)
                )
                yield Step(frame=step.frame, claims=(*step.claims, *wheel))

    def differences(text):
        attacked = attack(Two(curve()), text)
        poses = {"/odom": [], "/wheel": []}
        for step in attacked.steps():
            for claim in step.claims:
                if isinstance(claim, PoseClaim):
                    poses[claim.source].append(claim.T_odom_body.t)
        return attacked.labels[0].sources, np.abs(np.array(poses["/odom"]) - np.array(poses["/wheel"])).max()

    assert differences("odometry-offset:magnitude=2,start=9") == (("/odom", "/wheel"), 0.0)
    sources, apart = differences("odometry-offset:magnitude=2,start=9,source=/wheel")
    assert sources == ("/wheel",)
    assert apart > 1.0
    assert differences("odometry-noise:sigma=0.1,start=9")[1] > 0.0


def test_it_is_the_recording_otherwise(curve):
    source = curve()
    attacked = attack(source, "imu-freeze:start=5")
    assert attacked.cameras is source.cameras
    assert attacked.body_axes == "flu"
    assert np.array_equal(attacked.frame_stamps_ns(), source.frame_stamps_ns())
    assert attacked.position_frame == source.position_frame
    assert [spec.name for spec in attacked.specs] == ["imu-freeze"]
    with pytest.raises(AttributeError):
        _ = attacked.no_such_thing


def test_nothing_is_read_before_it_is_asked_for(curve):
    source = curve(frames=31)
    opened = source.opened
    attack(source, ["paper-odometry:start=9", "imu-freeze:start=5"])
    assert source.opened == opened


def test_labels(curve):
    source = curve()
    stamps = source.frame_stamps_ns()
    attacked = attack(
        source,
        [
            "paper-odometry:start=9",
            "imu-bias:rate=1,start=0.45s,stop=2s,seed=3",
            "position-freeze:start=20",
            "camera-black:start=4",
        ],
    )
    odometry, imu, position, camera = attacked.labels
    assert (odometry.start_frame, odometry.stop_frame, odometry.sources) == (9, 19, ("/odom",))
    assert odometry.alert is AlertType.ODOMETRY_SPOOFING
    assert odometry.onset_ns == stamps[9]
    assert odometry.end_ns == stamps[19]
    assert (imu.start_frame, imu.stop_frame, imu.seed) == (5, 20, 3)
    assert imu.alert is AlertType.ODOMETRY_SPOOFING
    assert imu.onset_ns == stamps[5] + 2_000_000
    assert (position.alert, position.stop_frame) == (AlertType.POSITION_SPOOFING, FRAMES)
    assert (position.start_ns, position.onset_ns) == (stamps[20], stamps[20] + 33_000_000)
    assert position.end_ns == stamps[-1]
    assert (camera.alert, camera.sources, camera.onset_ns) == (AlertType.CAMERA_FAULT, ("/image",), stamps[4])
    assert camera.text == "camera-black:start=4"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("paper-odometry", "starts at frame 100, but the recording has 30 frames"),
        ("imu-freeze:start=9s", "starts at frame 30, but"),
        ("imu-freeze:start=9,stop=9", "not after its start at 9"),
        ("camera-replay:start=5,delay=6", "never recorded"),
        ("odometry-replay:start=5,delay=0.6s", "never recorded"),
    ],
)
def test_spans_that_make_no_sense(curve, text, says):
    with pytest.raises(AttackError, match=says):
        attack(curve(), text)


def test_a_topic_that_is_not_there(curve):
    attacked = attack(curve(), "odometry-freeze:start=5,source=/wheel")
    with pytest.raises(
        AttackError,
        match=r"no odometry claims of /wheel .* has /detections \(detections\), /gps \(position\), /imu \(imu\), /odom",
    ):
        _ = attacked.labels
    with pytest.raises(AttackError, match="no odometry claims of /wheel"):
        list(attacked.steps())


class Stamped:
    """Frames at given stamps and no claims."""

    def __init__(self, *stamps):
        self.stamps, self.cameras, self.body_axes = stamps, {}, "flu"

    def frame_stamps_ns(self):
        return np.array(self.stamps, dtype=np.int64)

    def steps(self):
        return iter(())


def test_stamps_that_make_no_sense():
    with pytest.raises(AttackError, match="no frames"):
        attack(Stamped(), "imu-freeze:start=0")
    with pytest.raises(AttackError, match="run backwards at frame 2"):
        attack(Stamped(0, 20, 10), "imu-freeze:start=0")
    with pytest.raises(AttackError, match="a frame rate is needed"):
        attack(Stamped(7), "imu-replay:start=0")


def test_late_claims_do_not_disturb(curve, bits, claims_of):
    class Late:
        """Every fourth pose with its twist, and some positions, come one step late."""

        def __init__(self, source):
            self.cameras, self.body_axes = source.cameras, source.body_axes
            self.frame_stamps_ns, self._source = source.frame_stamps_ns, source

        def steps(self):
            late = ()
            for step in self._source.steps():
                kept = tuple(c for c in step.claims if (c.stamp_ns // 20_000_000) % 4)
                held = tuple(c for c in step.claims if not (c.stamp_ns // 20_000_000) % 4)
                yield Step(frame=step.frame, claims=(*kept, *late))
                late = held

    offset = "odometry-offset:rate=0.2,axis=x,start=10,stop=20"
    punctual = {c.stamp_ns: bits(c) for c in claims_of(attack(curve(), offset), PoseClaim)}
    late = claims_of(attack(Late(curve()), offset), PoseClaim)
    assert len(late) > 140
    assert all(bits(claim) == punctual[claim.stamp_ns] for claim in late)

    frozen = attack(Late(curve()), "odometry-freeze:start=10,stop=20")
    label = frozen.labels[0]
    poses = [c for c in claims_of(frozen, PoseClaim) if label.start_ns <= c.stamp_ns < label.end_ns]
    assert len(poses) == 50
    assert len({bits(claim.T_odom_body) for claim in poses}) == 1
