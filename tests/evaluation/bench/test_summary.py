"""Tables from records: counts, intervals, the smallest lie, the furthest drift."""

from dataclasses import replace

import pytest

from belie.evaluation.bench.curves import operating_curve, roc_figure
from belie.evaluation.bench.rivals import rival_maker
from belie.evaluation.bench.store import RunRecord
from belie.evaluation.bench.suite import parse_suite
from belie.evaluation.bench.summary import summarise
from belie.evaluation.bench.sweep import FACTORS, exceedances
from belie.evaluation.bench.tables.cells import false_alerts, furthest, rate, smallest
from belie.evaluation.bench.tables.selections import condition
from belie.evaluation.bench.words import markdown
from belie.types import CheckResult, Status, Verdict

HONEST = RunRecord(
    key="h", rival="default", recording="street sunny 1", place="street-straight", weather="sunny", seed=1,
    honest_s=360.0, frames=100, undecided=5, latency_ms=(1.0, 2.0, 3.0), decode_ms=(0.5,), size="64x48",
    episodes={"odometry_spoofing": [3] * 10 + [0] * 21},
)  # fmt: skip
ATTACKED = replace(
    HONEST, key="a", family="lateral", goal="OS", spec="odometry-offset:…", alert="odometry_spoofing", caught=True,
    delay_frames=1, delay_ms=120.0, right_first=True, onset=100, episodes={},
    delays={"odometry_spoofing": [0] * 15 + [2] * 6 + [None] * 10},
)  # fmt: skip
SUITE = {
    "title": "t", "rivals": ["default", "gate"], "drives": [{"scenarios": ["street-straight"]}],
    "attacks": [{"family": "lateral", "goal": "OS", "specs": ["odometry-freeze"]}],
}  # fmt: skip


def table(summary, start):
    return next(one for one in summary.tables if one.title.startswith(start))


def test_rates_come_with_their_intervals_and_never_alone():
    assert rate([ATTACKED] * 9 + [replace(ATTACKED, caught=False)]) == "9/10 (60–98 %)"
    assert rate([]) == "–"


def test_what_a_detector_does_not_judge_is_not_held_against_it():
    makers = {name: rival_maker(name) for name in ("default", "gate")}
    hidden = replace(ATTACKED, alert="obstacle_hiding", goal="OH", caught=False)
    records = [hidden, replace(hidden, rival="gate")]
    summary = summarise(parse_suite(SUITE), records, makers)
    assert table(summary, "Attacks caught").rows == (("lateral", "no fog", "0/1 (0–79 %)", "–"),)


def test_false_alerts_are_counted_in_honest_runs_with_an_upper_bound():
    alerted = replace(HONEST, false_alerts=("frame 3: imu",))
    summary = summarise(parse_suite(SUITE), [HONEST, alerted], {})
    rows = table(summary, "False alerts").rows
    # Garwood, one event: 4.744 in 12 minutes, of which no rate an hour is told.
    assert rows == (("default", "street-straight sunny", "2", "12.0 min", "1", "–", "23.7", "5 %"),)
    assert summary.false_alerts == ("street sunny 1: frame 3: imu",)


def test_a_rate_an_hour_is_told_where_an_hour_was_driven():
    assert false_alerts([replace(HONEST, honest_s=6.0)] * 2) == "0 in 12 s (at most 899 an hour)"
    driven = [replace(HONEST, honest_s=3600.0, false_alerts=("frame 3: imu",) * 3)] * 2
    assert false_alerts(driven) == "6 in 2.0 h, 3 an hour (at most 5.92 an hour)"
    other = replace(HONEST, place="highway")
    rows = table(summarise(parse_suite(SUITE), [HONEST, other], {}), "False alerts").rows
    assert [row[1] for row in rows] == ["street-straight sunny", "highway sunny", "all"]


def test_who_accuses_all_the_time_is_not_praised_for_its_attribution():
    noisy = replace(
        ATTACKED, during=9, wrong=("frame 101: imu",) * 4, before_onset=("frame 1: imu",) * 2,
        false_alerts=("frame 1: imu",) * 2 + ("frame 102: imu",) * 5 + ("frame 200: imu",),
        aftermath=("frame 200: imu",),
    )  # fmt: skip
    (row,) = table(summarise(parse_suite(SUITE), [noisy], {}), "Delay").rows
    assert row[-2:] == ("10 %", "2 / 9 / 1")


def test_what_was_missed_is_told_with_what_the_check_said():
    def missed(why, nearest):
        return replace(ATTACKED, caught=False, why_missed=why, nearest=nearest)

    dark, far = "odometry undecided: too dark", "odometry consistent"
    records = [
        replace(missed(far, 0.2), object_px=(19, 20)),
        missed(dark, None),
        replace(missed(far, 0.81), object_px=(34, 43)),
        ATTACKED,
        replace(missed("", None), rival="gate"),
    ]
    summary = summarise(parse_suite(SUITE), records, {})
    assert table(summary, "What was missed").rows == (
        ("default", "lateral", "no fog", "2", far, "0.81", "20–43"),
        ("default", "lateral", "no fog", "1", dark, "–", "–"),
    )
    assert f"street sunny 1, odometry-offset:…: {dark}" in summary.missed


def test_published_figures_stand_in_their_own_columns():
    suite = parse_suite({**SUITE, "rivals": ["default", "paper", "boxes"]})
    records = [replace(ATTACKED, rival=rival) for rival in suite.rivals]
    summary = summarise(suite, records, {})
    found, cost = table(summary, "The paper's Table I"), table(summary, "Latency by attack")
    assert [found.rows[1][i] for i in found.published] == ["the paper's detector", "99.5 % (all)", "0 %"]
    assert [cost.rows[1][i] for i in cost.published] == ["the paper's detector", "75", "82", "64", "66"]
    assert cost.rows[0][1:5] == ("2.0 / 2.9", "–", "–", "–")
    assert all(one.rows[0][i] == "–" for one in (found, cost) for i in one.published)
    assert found.rows[0][1] == "1/1 (21–100 %)"
    # Nobody knows what OS and PS are.
    assert not any(short in " ".join(one.head) for one in (found, cost) for short in ("OS", "PS", "OH", "OM"))


def test_the_smallest_lie_is_the_last_before_one_is_missed():
    def at(magnitude, caught):
        return replace(ATTACKED, magnitude=magnitude, caught=caught)

    swept = [at(0.2, True), at(0.1, True), at(0.05, False), at(0.02, True)]
    assert smallest(swept, (0.2, 0.1, 0.05, 0.02), "m") == "0.1 m (1)"
    assert smallest([at(0.2, False)], (0.2,), "m") == "> 0.2 m"
    assert smallest([], (0.2,), "m") == "–"


def test_the_furthest_drift_is_that_of_the_best_rate():
    def ramp(speed, delay_ms):
        return replace(
            ATTACKED, magnitude=speed, onset=100, honest_s=10.0, frames=800, caught=delay_ms is not None,
            delay_ms=delay_ms,
        )  # fmt: skip

    runs = [ramp(2.0, 1500.0), ramp(0.5, 20_000.0), ramp(0.1, None)]
    assert furthest(runs, 10.0, "m/s") == "5 m (0.5 m/s)"
    assert furthest(runs, 60.0, "m/s") == "10 m (0.5 m/s)"
    assert furthest([replace(runs[2], frames=150)], 60.0, "m/s") == "–"  # the run is too short to tell


def test_what_is_lower_than_the_threshold_is_found_at_a_lower_factor():
    def verdict(k, x):
        check = CheckResult(
            check="odometry", source="/odom", status=Status.CONSISTENT, statistic=x, threshold=10.0
        )
        return Verdict(frame=k, stamp_ns=k, status=Status.CONSISTENT, latency_ms=1.0, checks=(check,))

    found = exceedances([verdict(k, x) for k, x in enumerate([1.0, 6.0, 2.0, 7.0, 8.0])], [])
    counts = dict(zip(FACTORS, found.episodes["odometry_spoofing"], strict=True))
    assert counts[0.502] == 2
    assert counts[1.0] == 0


def test_the_curve_trades_false_alarms_for_detections():
    curve = operating_curve([HONEST, ATTACKED], "default", "odometry_spoofing")
    assert curve[0] == (30.0, 1.0, 0.0)
    assert curve[-1] == (0.0, 0.0, None)
    assert len(curve) == len(FACTORS)


def test_every_detector_that_is_drawn_is_named_and_axes_begin_at_zero():
    boxes = replace(
        ATTACKED, rival="boxes", alert="object_misclassification", goal="OM",
        delays={"object_misclassification": [0] * 31},
    )  # fmt: skip
    records = [HONEST, ATTACKED, replace(HONEST, rival="boxes"), boxes]
    drawn = roc_figure(records, ["default", "boxes", "silent"])
    for text in ("default", "boxes", "false alarms in 6.0 min"):
        assert f">{text}</text>" in drawn, text
    assert ">silent</text>" not in drawn
    assert "−0.0" not in drawn  # delays below zero frames


def test_markdown_holds_every_table_and_list():
    missed = replace(ATTACKED, caught=False)
    suite = parse_suite(SUITE)
    text = markdown(suite, summarise(suite, [HONEST, missed], {}, [("run x", "broke")]), "how")
    for part in (
        "## Attacks caught",
        "## Missed by the first detector",
        "- run x: broke",
        "| default | street-straight sunny |",
    ):
        assert part in text


@pytest.mark.parametrize(
    ("place", "weather", "said"),
    [("highway", "light-fog", "light fog"), ("street", "rainy-night", "no fog"), ("kitti00", "real", "real")],
)
def test_conditions_are_those_of_the_paper(place, weather, said):
    assert condition(replace(HONEST, place=place, weather=weather)) == said


def test_a_test_that_stops_at_its_threshold_is_caught_at_factor_one():
    """The sums of the object checks are cut at the threshold, so that they can end soon."""
    result = CheckResult(
        check="hiding",
        source="/detections",
        status=Status.CONTRADICTED,
        statistic=16.2,
        threshold=16.2,
        unit="llr",
    )
    verdict = Verdict(frame=0, stamp_ns=0, status=Status.CONTRADICTED, latency_ms=1.0, checks=(result,))
    found = exceedances([verdict], []).episodes["obstacle_hiding"]
    assert found[FACTORS.index(1.0)] == 1
