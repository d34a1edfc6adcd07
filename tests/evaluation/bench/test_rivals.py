"""The detectors of the benchmark: what was seen once is told the same, and gates are the gates they say they are."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from belie.attacks import attack
from belie.detector import Config
from belie.evaluation.bench.measure import measure
from belie.evaluation.bench.rivals import judges, rival_maker
from belie.evaluation.bench.rivals.belie_rival import BelieRival
from belie.evaluation.bench.rivals.boxes import LENGTH, features
from belie.evaluation.bench.rivals.gate import InnovationGate, MahalanobisGate
from belie.evaluation.bench.rivals.network import Network
from belie.evaluation.bench.rivals.objectness import CELL_PX, largest_cluster
from belie.evaluation.bench.rivals.remembered import OtherImagesError
from belie.types import AlertType, ConfigError, Detection, DetectionClaim


def told(found):
    columns = found.table.columns
    return [columns[name] for name in ("frame", "status", "alerts", "check", "statistic", "check_status")]


def test_what_was_seen_once_gives_the_same_verdicts_on_attacked_claims(small_drive):
    first = BelieRival(small_drive.cameras, Config())
    measure(small_drive.steps(), [], first)
    attacked = attack(small_drive, "odometry-offset:axis=left,rate=0.2,start=40,stop=50")
    labels = attacked.labels
    looked = measure(attacked.steps(), labels, BelieRival(small_drive.cameras, Config()))
    remembering = BelieRival(small_drive.cameras, Config(), sights=first.sights)
    remembered = measure(attacked.steps(), labels, remembering)
    assert looked.score.hits == 1
    assert told(remembered) == told(looked)
    assert remembering.sights is None  # it did not look, and has nothing to hand on


def test_the_time_of_looking_is_counted_where_it_was_not_spent(small_drive):
    first = BelieRival(small_drive.cameras, Config())
    measure(small_drive.steps(), [], first)
    again = BelieRival(small_drive.cameras, Config(), sights=first.sights)
    steps = list(small_drive.steps())
    again.update(steps[0])
    again.update(steps[1])
    assert again.saved_ms == first.sights[1].spent_ms > 0.0


def test_other_images_are_not_taken_for_those_that_were_seen(small_drive):
    first = BelieRival(small_drive.cameras, Config())
    measure(small_drive.steps(), [], first)
    frozen = attack(small_drive, "camera-black:start=30")
    with pytest.raises(OtherImagesError):
        measure(
            frozen.steps(), frozen.labels, BelieRival(small_drive.cameras, Config(), sights=first.sights[:20])
        )


@pytest.mark.parametrize("kind", [InnovationGate, MahalanobisGate])
def test_a_gate_is_silent_on_honest_claims_and_catches_jumps(small_drive, kind):
    honest = measure(small_drive.steps(), [], kind(small_drive.cameras))
    assert honest.score.false_alerts == ()
    jump = attack(small_drive, "position-offset:axis=x,magnitude=20,source=/gnss,start=50")
    found = measure(jump.steps(), jump.labels, kind(small_drive.cameras))
    assert found.score.hits == 1
    assert found.score.labels[0].delay_frames <= 2


def test_a_gate_swallows_what_grows_slowly(small_drive):
    slow = attack(small_drive, "position-ramp:axis=x,rate=0.3,source=/gnss,start=50")
    assert measure(slow.steps(), slow.labels, InnovationGate(small_drive.cameras)).score.hits == 0


def test_the_gates_are_five_sigma_an_axis_and_five_of_all_axes_together():
    nu, S = np.array([4.9, 4.9, 0.0]), np.eye(3)
    assert InnovationGate({}).ratio(nu, S) == pytest.approx(0.98)
    assert MahalanobisGate({}).ratio(nu, S) == pytest.approx(np.hypot(4.9, 4.9) / 5.0)


def test_a_network_is_read_as_it_was_written(tmp_path):
    rng = np.random.default_rng(0)
    net = Network(
        mean=np.ones(3), scale=np.full(3, 2.0), weights=(rng.normal(size=(3, 4)), rng.normal(size=(4, 2))),
        biases=(rng.normal(size=4), rng.normal(size=2)), labels=("car", "person"), threshold=1.5,
    )  # fmt: skip
    net.save(tmp_path / "net.npz")
    read = Network.load(tmp_path / "net.npz")
    inputs = rng.normal(size=(5, 3))
    assert read.labels == net.labels
    assert read.threshold == net.threshold
    np.testing.assert_allclose(read.probabilities(inputs), net.probabilities(inputs), atol=5e-3)
    with pytest.raises(ConfigError, match=r"rivals\.train makes it"):
        Network.load(tmp_path / "none.npz")


def test_features_of_a_track_tell_its_last_box_and_its_drift():
    still = np.tile([0.4, 0.4, 0.6, 0.5], (LENGTH, 1))
    moving = still + np.linspace(0.0, 0.1, LENGTH)[:, None]
    assert np.allclose(features(still)[5:], 0.0)
    assert np.allclose(features(moving)[5::5][: LENGTH - 1], 0.1 / (LENGTH - 1))


def test_clusters_join_over_corners():
    cells = np.zeros((5, 5), bool)
    cells[0, 0] = cells[1, 1] = cells[4, 4] = True
    assert largest_cluster(cells) == 2
    assert largest_cluster(np.zeros((5, 5), bool)) == 0
    assert CELL_PX == 8


def test_rivals_say_what_they_judge():
    assert judges(InnovationGate) == {AlertType.ODOMETRY_SPOOFING, AlertType.POSITION_SPOOFING}
    assert rival_maker("paper").config.profile == "paper"


@pytest.mark.parametrize(
    ("name", "said"),
    [("json:JSONEncoder", "no class with a method update"), ("no_such:Thing", "No module named")],
)
def test_a_rival_that_cannot_be_used_is_refused(name, said):
    with pytest.raises(ConfigError, match=said):
        rival_maker(name)


def documented(name):
    """A class of the examples in the document, as a user copies it."""
    text = (Path(__file__).parents[3] / "docs" / "benchmark.md").read_text(encoding="utf-8")
    (code,) = [c for c in re.findall(r"```python\n(.*?)```", text, re.DOTALL) if f"class {name}" in c]
    space = {}
    exec(code, space)
    return space[name]


def test_the_documented_detectors_find_what_they_are_for(small_drive):
    box = Detection(label="car", score=0.9, track_id="7", box_px=np.array([60.0, 60, 120, 120]))
    told = tuple(
        replace(step, claims=(*step.claims, DetectionClaim(
            source="/detections", stamp_ns=step.frame.stamp_ns, received_ns=step.frame.stamp_ns, detections=(box,))))
        for step in small_drive.joined
    )  # fmt: skip
    drive = replace(small_drive, joined=told)
    for name, spec in (
        ("JumpDetector", "position-offset:axis=x,magnitude=30,source=/gnss,start=40"),
        ("VanishDetector", "detections-hide:start=40,stop=50"),
    ):
        attacked = attack(drive, spec)
        rival = documented(name)(drive.cameras)
        assert measure(attacked.steps(), attacked.labels, rival).score.hits == 1
        assert measure(drive.steps(), [], documented(name)(drive.cameras)).score.false_alerts == ()


class Homeless:
    def update(self, step):
        return []


def test_a_rival_that_takes_no_cameras_is_told_to():
    with pytest.raises(ConfigError, match=r"is made with the cameras: write def __init__\(self, cameras\)"):
        rival_maker(f"{__name__}:Homeless")
