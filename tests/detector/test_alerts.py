from belie.detector.alerts import AlertBook, Judgement
from belie.types import CheckResult, Status


def judgement(status, check="odometry", source="/odom", onset=None):
    return Judgement(
        result=CheckResult(check=check, source=source, status=status, reason="r"), onset_ns=onset
    )


def test_an_alert_is_raised_once_and_again_after_it_ended():
    book = AlertBook()
    lie, truth, blind = (judgement(s) for s in (Status.CONTRADICTED, Status.CONSISTENT, Status.UNDECIDED))
    raised = [len(book.raise_new([j], i)) for i, j in enumerate([truth, lie, lie, blind, lie, truth, lie])]
    assert raised == [0, 1, 0, 0, 0, 0, 1]


def test_pose_and_twist_of_one_stream_are_one_accusation_with_the_earlier_onset():
    alerts = AlertBook().raise_new(
        [judgement(Status.CONTRADICTED, onset=7), judgement(Status.CONTRADICTED, check="twist", onset=5)], 9
    )
    assert [(a.type.value, a.source, a.onset_ns) for a in alerts] == [("odometry_spoofing", "/odom", 5)]


def test_streams_are_accused_apart():
    alerts = AlertBook().raise_new(
        [judgement(Status.CONTRADICTED), judgement(Status.CONTRADICTED, "imu", "/imu"),
         judgement(Status.CONTRADICTED, "position", "/fix"), judgement(Status.CONTRADICTED, "camera", "/image")], 9
    )  # fmt: skip
    assert [a.type.value for a in alerts] == [
        "odometry_spoofing", "odometry_spoofing", "position_spoofing", "camera_fault",
    ]  # fmt: skip


def test_what_is_undecided_of_all_objects_acquits_none():
    book = AlertBook()
    lie = CheckResult(check="hiding", source="/d", status=Status.CONTRADICTED, object="7")
    blind = CheckResult(check="hiding", source="/d", status=Status.UNDECIDED, reason="no message for 1 s")
    fine = CheckResult(check="hiding", source="/d", status=Status.CONSISTENT)
    raised = [
        len(book.raise_new([Judgement(result=result)], i))
        for i, result in enumerate([lie, blind, lie, fine, lie])
    ]
    assert raised == [1, 0, 0, 0, 1]
