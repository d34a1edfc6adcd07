"""Scores: hits, misses, delays, wrong accusations and false alerts, with their intervals."""

import json
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest, poisson

from belie.attacks import AttackLabel
from belie.evaluation.intervals import poisson_upper, wilson_interval
from belie.evaluation.score import Score, pool_scores, score
from belie.types import Alert, AlertType, Status, Verdict

FRAME_NS = 100_000_000
ODOMETRY, POSITION = AlertType.ODOMETRY_SPOOFING, AlertType.POSITION_SPOOFING


def label(start, stop, alert=ODOMETRY, sources=("/odom",), late_ns=0):
    return AttackLabel(
        name="odometry-freeze",
        text=f"odometry-freeze:start={start},stop={stop}",
        stream="odometry",
        sources=sources,
        alert=alert,
        start_frame=start,
        stop_frame=stop,
        start_ns=start * FRAME_NS,
        onset_ns=start * FRAME_NS + late_ns,
        end_ns=stop * FRAME_NS,
        seed=0,
    )


def run(alerts, frames=100, first=0):
    """Verdicts at 10 Hz; `alerts` maps a frame to (type, source) pairs."""
    return [
        Verdict(
            frame=k,
            stamp_ns=k * FRAME_NS,
            status=Status.CONSISTENT,
            latency_ms=1.0,
            alerts=tuple(Alert(type=t, source=s, onset_ns=0) for t, s in alerts.get(k, ())),
        )
        for k in range(first, frames)
    ]


def test_hit_and_its_delay():
    result = score(run({33: [(ODOMETRY, "/odom")], 35: [(ODOMETRY, "/odom")]}), [label(30, 40)])
    only = result.labels[0]
    assert (result.hits, only.hit.frame, only.delay_frames, only.delay_ms) == (1, 33, 3, 300.0)
    assert not (result.false_alerts)
    assert not (result.wrong_attributions)
    assert not (result.before_onset)
    assert (result.success_within(3), result.success_within(2)) == (1.0, 0.0)


def test_frames_of_delay_are_those_that_were_checked():
    dropped = [v for v in run({36: [(ODOMETRY, "/odom")]}) if v.frame not in (31, 33)]
    only = score(dropped, [label(30, 40)]).labels[0]
    assert (only.delay_frames, only.delay_ms) == (4, 600.0)


def test_a_message_stamped_after_its_frame_is_no_negative_delay():
    only = score(run({30: [(ODOMETRY, "/odom")]}), [label(30, 40, late_ns=33_000_000)]).labels[0]
    assert (only.delay_frames, only.delay_ms) == (0, 0.0)


@pytest.mark.parametrize("late_frames", [0.0, 2.9, 3.0, 3.4])
def test_both_delays_count_from_the_first_message_that_lies(late_frames):
    late_ns = round(late_frames * FRAME_NS)
    only = score(run({36: [(ODOMETRY, "/odom")]}), [label(30, 40, late_ns=late_ns)]).labels[0]
    assert only.delay_frames == 6 - round(late_frames)
    assert only.delay_ms == pytest.approx(600.0 - 100.0 * late_frames)


def test_an_alert_before_the_attack_is_never_a_hit():
    result = score(run({29: [(ODOMETRY, "/odom")]}), [label(30, 40)])
    assert result.hits == 0
    assert [raised.frame for raised in result.false_alerts] == [29]
    assert result.before_onset == result.false_alerts


@pytest.mark.parametrize(("frame", "hit"), [(40, True), (50, True), (51, False)])
def test_grace_after_the_end(frame, hit):
    result = score(run({frame: [(ODOMETRY, "/odom")]}), [label(30, 40)], grace_s=1.0)
    assert (result.hits == 1) is hit
    assert (len(result.false_alerts) == 1) is not hit
    assert not result.before_onset


@pytest.mark.parametrize(
    ("raised", "onset", "aftermath", "false"),
    [
        (45, 40, 1, 0),  # within the grace, about honest frames
        (45, 39, 0, 0),  # late, but about the attack
        (39, 38, 0, 0),  # told again while it is attacked
        (60, 39, 1, 1),  # after the grace
        (20, 19, 0, 1),  # before the attack
    ],
)
def test_alerts_about_honest_frames_after_an_attack_are_counted(raised, onset, aftermath, false):
    def alert(frame):
        return (Alert(type=ODOMETRY, source="/odom", onset_ns=frame * FRAME_NS),)

    found = [
        replace(v, alerts=alert({32: 30, raised: onset}[v.frame])) if v.frame in (32, raised) else v
        for v in run({})
    ]
    result = score(found, [label(30, 40)])
    assert (result.hits, len(result.aftermath), len(result.false_alerts)) == (1, aftermath, false)
    assert [one.frame for one in result.aftermath] == [raised] * aftermath
    assert len(pool_scores([result, result]).aftermath) == 2 * aftermath
    assert len(result.to_json()["aftermath"]) == aftermath


def test_the_late_alert_that_is_the_hit_is_no_aftermath():
    late = [
        replace(v, alerts=(Alert(type=ODOMETRY, source="/odom", onset_ns=41 * FRAME_NS),))
        if v.frame == 45
        else v
        for v in run({})
    ]
    result = score(late, [label(30, 40)])
    assert (result.hits, result.aftermath) == (1, ())


@pytest.mark.parametrize(("onset", "hits"), [(39, 1), (40, 0)])
def test_the_true_name_that_comes_back_after_a_false_one_is_no_hit(onset, hits):
    renamed = replace(
        label(30, 40), stream="detections", sources=("/detections",), alert=AlertType.OBJECT_MISCLASSIFICATION
    )
    alert = Alert(type=renamed.alert, source="/detections", onset_ns=onset * FRAME_NS)
    found = [replace(v, alerts=(alert,)) if v.frame == 44 else v for v in run({})]
    result = score(found, [renamed])
    assert (result.hits, len(result.wrong_attributions), len(result.aftermath)) == (hits, 1 - hits, 1 - hits)


@pytest.mark.parametrize("accused", [(POSITION, "/odom"), (ODOMETRY, "/imu")])
def test_wrong_type_or_source_is_listed_apart(accused):
    result = score(run({33: [accused], 34: [(ODOMETRY, "/odom")]}), [label(30, 40)])
    assert [raised.frame for raised in result.wrong_attributions] == [33]
    assert result.labels[0].hit.frame == 34
    assert not result.false_alerts


def test_overlapping_attacks_are_told_apart_by_type_and_source():
    labels = [label(30, 50), label(40, 60, POSITION, ("/gps",)), label(32, 50)]
    alerts = {35: [(ODOMETRY, "/odom")], 45: [(POSITION, "/gps")], 46: [(POSITION, "/odom")]}
    result = score(run(alerts), labels)
    assert [scored.delay_frames for scored in result.labels] == [5, 5, 3]
    assert [raised.frame for raised in result.wrong_attributions] == [46]


def test_two_attacks_need_two_alerts():
    result = score(run({35: [(ODOMETRY, "/odom")]}), [label(30, 40), label(60, 70)])
    assert [scored.hit is not None for scored in result.labels] == [True, False]
    assert (result.success_rate, result.hits) == (0.5, 1)
    between = score(run({55: [(ODOMETRY, "/odom")]}), [label(30, 40), label(60, 70)])
    assert len(between.false_alerts) == 1
    assert not between.before_onset


def test_false_alerts_an_hour_count_honest_time_only():
    # 9.9 s in all, of which 3.0 to 5.0 s (grace included) are attacked.
    result = score(run({10: [(ODOMETRY, "/odom")], 90: [(POSITION, "/gps")]}), [label(30, 40)])
    assert result.honest_s == pytest.approx(7.9)
    assert result.false_alerts_per_hour == pytest.approx(2 / 7.9 * 3600)
    assert [raised.frame for raised in result.before_onset] == [10]


def test_honest_time_is_what_no_span_covers():
    labels = [label(30, 40), label(35, 60), label(95, 100), label(0, 2)]
    assert score(run({}), labels).honest_s == pytest.approx((30 - 12 + 95 - 70) / 10)
    assert score(run({}, first=50), [label(10, 20)]).honest_s == pytest.approx(4.9)
    assert score(run({}, first=45), [label(10, 40)]).honest_s == pytest.approx(4.9)
    covered = score(run({}), [label(0, 100)])
    assert covered.honest_s == 0.0
    assert covered.false_alerts_per_hour is None
    assert covered.false_alerts_per_hour_upper is None


def test_honest_runs():
    result = score(run({7: [(ODOMETRY, "/odom")]}), [])
    assert (result.success_rate, result.success_interval, result.success_within(3)) == (None, None, None)
    assert len(result.false_alerts) == 1
    assert not result.before_onset
    assert score([], []).honest_s == 0.0


def test_pooling_adds_up():
    one = score(run({33: [(ODOMETRY, "/odom")]}), [label(30, 40)])
    two = score(run({10: [(ODOMETRY, "/odom")]}), [label(30, 40)])
    both = pool_scores([one, two])
    assert (both.hits, len(both.labels), both.success_rate) == (1, 2, 0.5)
    assert both.honest_s == pytest.approx(one.honest_s + two.honest_s)
    assert both.before_onset == two.before_onset
    assert pool_scores([]) == Score()
    with pytest.raises(ValueError, match="confidence"):
        pool_scores([one, Score(confidence=0.9)])


def test_json_is_json():
    alerts = {10: [(POSITION, "/gps")], 33: [(ODOMETRY, "/odom"), (ODOMETRY, "/imu")]}
    told = json.loads(json.dumps(score(run(alerts), [label(30, 40), label(60, 70)]).to_json()))
    assert (told["attacks"], told["hits"], told["success_rate"]) == (2, 1, 0.5)
    assert told["labels"][0]["hit"]["frame"] == 33
    assert told["labels"][0]["delay_ms"] == 300.0
    assert told["labels"][1]["hit"] is None
    assert told["wrong_attributions"][0]["source"] == "/imu"
    assert told["false_alerts"][0]["type"] == "position_spoofing"
    assert len(told["before_onset"]) == 1


@given(st.integers(0, 200), st.integers(0, 200), st.floats(0.5, 0.999))
def test_wilson_agrees_with_scipy(successes, failures, confidence):
    trials = successes + failures
    interval = wilson_interval(successes, trials, confidence)
    if trials == 0:
        assert interval is None
        return
    wanted = binomtest(successes, trials).proportion_ci(confidence, method="wilson")
    assert interval == pytest.approx((wanted.low, wanted.high), abs=1e-9)
    assert interval[0] <= successes / trials <= interval[1]


@given(st.integers(0, 500), st.floats(0.5, 0.999))
def test_garwood_bound_is_where_so_few_events_become_unlikely(count, confidence):
    assert poisson.cdf(count, poisson_upper(count, confidence)) == pytest.approx(1 - confidence, abs=1e-9)


def test_misuse_is_refused():
    with pytest.raises(ValueError, match="grace_s"):
        score([], [], grace_s=-1.0)
    with pytest.raises(ValueError, match="confidence"):
        score([], [], confidence=1.0)
    with pytest.raises(ValueError, match="successes"):
        wilson_interval(3, 2)
    with pytest.raises(ValueError, match="not negative"):
        poisson_upper(-1)


HIDING, INJECTION = AlertType.OBSTACLE_HIDING, AlertType.OBSTACLE_INJECTION
RELABELLED = AlertType.OBJECT_MISCLASSIFICATION


def object_label(kind="hide", alert=HIDING, object="7", other=None):
    return AttackLabel(
        name=f"detections-{kind}",
        text=f"detections-{kind}:start=30,stop=40",
        stream="detections",
        sources=("/detections",),
        alert=alert,
        start_frame=30,
        stop_frame=40,
        start_ns=30 * FRAME_NS,
        onset_ns=30 * FRAME_NS,
        end_ns=40 * FRAME_NS,
        seed=0,
        object=object,
        other=other,
    )


def object_run(alert_type, object, frame=33, source="/detections"):
    alert = Alert(type=alert_type, source=source, onset_ns=0, object=object)
    empty = run({})
    return [*empty[:frame], replace(empty[frame], alerts=(alert,)), *empty[frame + 1 :]]


@pytest.mark.parametrize(
    ("kind", "attack_type", "object", "raised", "named", "hits", "false", "wrong"),
    [
        ("hide", HIDING, "7", HIDING, "7", 1, 0, 0),
        ("hide", HIDING, "7", HIDING, "8", 0, 1, 0),  # another object: a false alert
        ("hide", HIDING, "7", HIDING, None, 1, 0, 0),
        ("hide", HIDING, None, HIDING, "#3", 1, 0, 0),  # no ids: belie numbers the objects itself
        ("hide", HIDING, "7", INJECTION, "7", 0, 0, 1),  # the right object, but no hiding
        ("hide", HIDING, "7", ODOMETRY, None, 0, 0, 1),
        ("shift", HIDING, "7", INJECTION, "7", 1, 0, 0),
        ("shift", HIDING, "7", HIDING, "7", 1, 0, 0),
        ("shrink", HIDING, "7", INJECTION, "7", 1, 0, 0),
        ("delay", HIDING, None, INJECTION, "9", 1, 0, 0),
        ("relabel", RELABELLED, "7", RELABELLED, "7", 1, 0, 0),
        ("relabel", RELABELLED, "7", HIDING, "7", 0, 0, 1),
        ("phantom", INJECTION, "9001", INJECTION, "9001", 1, 0, 0),
        ("phantom", INJECTION, "9001", INJECTION, "7", 0, 1, 0),
    ],
)
def test_attacks_on_objects(kind, attack_type, object, raised, named, hits, false, wrong):
    result = score(object_run(raised, named), [object_label(kind, attack_type, object)])
    assert (result.hits, len(result.false_alerts), len(result.wrong_attributions)) == (hits, false, wrong)


def test_a_swap_may_be_told_of_either_object():
    swap = object_label("swap", RELABELLED, "7", other="9")
    assert [score(object_run(RELABELLED, name), [swap]).hits for name in ("7", "9", "8")] == [1, 1, 0]


def test_the_source_must_be_right_for_objects_too():
    result = score(object_run(HIDING, "7", source="/other"), [object_label()])
    assert (result.hits, len(result.wrong_attributions)) == (0, 1)


def test_scores_by_type():
    both = pool_scores(
        [
            score(object_run(HIDING, "7"), [object_label(), label(60, 70)]),
            score(object_run(INJECTION, "8"), [object_label("phantom", INJECTION, "9001")]),
        ]
    )
    parts = both.by_type()
    assert list(parts) == [ODOMETRY, HIDING, INJECTION]
    assert [(len(part.labels), part.hits, len(part.false_alerts)) for part in parts.values()] == [
        (1, 0, 0),
        (1, 1, 0),
        (1, 0, 1),
    ]
    told = both.to_json()
    assert told["by_type"]["obstacle_hiding"]["success_rate"] == 1.0
    assert [one["object"] for one in told["labels"]] == ["7", None, "9001"]
