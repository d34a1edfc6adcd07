"""Alerts of one detector about several objects, each with its own reason and end."""

from belie.evaluation.traced_alert import AlertRecorder
from belie.types import AccusedObject, Alert, AlertType, CheckResult, Status, Verdict

CAR = AccusedObject(label_before="car", box_px=(0.0, 0.0, 9.0, 9.0))


def told(check, name, status=Status.CONTRADICTED):
    return CheckResult(check=check, source="/d", status=status, object=name, reason=f"{check} {name}")


def verdict(k, *checks, alerts=()):
    return Verdict(
        frame=k, stamp_ns=k, status=Status.CONTRADICTED, latency_ms=1.0, checks=checks, alerts=alerts
    )


def test_each_object_has_its_own_reason_and_end():
    hidden, renamed = told("hiding", "7"), told("misclassification", "3")
    alerts = (
        Alert(type=AlertType.OBSTACLE_HIDING, source="/d", onset_ns=0, object="7", accused=CAR),
        Alert(type=AlertType.OBJECT_MISCLASSIFICATION, source="/d", onset_ns=0, object="3"),
    )
    recorder = AlertRecorder()
    recorder.add(verdict(0, hidden, renamed, alerts=alerts))
    recorder.add(verdict(1, hidden, told("misclassification", None, Status.CONSISTENT)))
    recorder.add(verdict(2, told("hiding", None, Status.UNDECIDED)))
    recorder.add(verdict(3, hidden))
    first, second = recorder.finish()
    assert (first.object, first.reason, first.end_ns) == ("car 7", "hiding 7", 3)
    assert (second.object, second.reason, second.end_ns) == ("3", "misclassification 3", 0)
