"""Sinks one by one: a failure stays where it is, nothing grows, nothing is lost silently."""

from __future__ import annotations

import json
import threading
import time
import urllib.request
from collections import Counter
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, HTTPServer

import numpy as np
import pytest
from live_tools import IMAGE, INFO, ODOM, TF, free_port, wait_until

from belie.bridges.board import Answer, Board, Input
from belie.bridges.settings import (
    AnswerSettings,
    EvidenceSettings,
    MqttSettings,
    RetrySettings,
    WebhookSettings,
)
from belie.bridges.sinks.annotated import AnnotatedSink
from belie.bridges.sinks.diagnostics import DiagnosticsSink, alert_status, statuses_of
from belie.bridges.sinks.evidence import EvidenceSink
from belie.bridges.sinks.evidence_bag import EvidenceBag
from belie.bridges.sinks.metrics import MetricsSink
from belie.bridges.sinks.outlet import Outlet
from belie.bridges.sinks.vda5050 import state_of
from belie.bridges.sinks.webhook import WebhookSink
from belie.bridges.wire import Received, now_ns
from belie.recordings import open_recording
from belie.recordings import topics as ros
from belie.types import (
    AccusedObject,
    Alert,
    AlertType,
    CheckResult,
    ConfigError,
    Frame,
    Status,
    TransportError,
    Verdict,
)

RETRY = RetrySettings(first_s=0.05, longest_s=0.1, waiting=5)


def answer(frame: int = 0, *, alert: bool = False, status: Status = Status.CONSISTENT) -> Answer:
    check = CheckResult(
        check="odometry", source=ODOM, status=status, statistic=1.0, threshold=9.0, floor="0.1 m"
    )
    alerts = (Alert(type=AlertType.ODOMETRY_SPOOFING, source=ODOM, onset_ns=5),) if alert else ()
    verdict = Verdict(
        frame=frame, stamp_ns=frame, status=status, latency_ms=2.0, checks=(check,), alerts=alerts
    )
    image = Frame(camera="/cam", stamp_ns=frame, received_ns=now_ns(), image=np.zeros((48, 64), np.uint8))
    return Answer(verdict=verdict, frame=image, decode_ms=1.0, answered_ns=now_ns())


def test_an_outlet_tries_again_keeps_the_order_and_drops_the_oldest():
    got, counts, broken = [], Counter(), threading.Event()
    broken.set()

    def deliver(item: int) -> None:
        if broken.is_set():
            raise OSError("down")
        got.append(item)

    outlet = Outlet("test", deliver, RETRY, counts)
    for item in range(10):
        outlet.give(item)
    assert wait_until(lambda: counts["failed"] >= 2)
    broken.clear()
    assert wait_until(lambda: counts["sent"] + counts["dropped"] == 10)
    outlet.close(1.0)
    assert got == sorted(got)
    assert got[-5:] == [5, 6, 7, 8, 9]
    assert len(got) + counts["dropped"] == 10


def test_an_outlet_that_hangs_delays_nobody():
    counts, hang = Counter(), threading.Event()
    outlet = Outlet("test", lambda item: hang.wait(5.0), RETRY, counts)
    began = time.monotonic()
    for item in range(1000):
        outlet.give(item)
    outlet.close(0.2)
    assert time.monotonic() - began < 1.0
    assert counts["dropped"] >= 990
    hang.set()


class Quiet(BaseHTTPRequestHandler):
    """Answers without a word on stderr."""

    def log_message(self, *args: object) -> None: ...


def serving(handler: type[BaseHTTPRequestHandler]) -> HTTPServer:
    """A server on loopback, at work."""
    server = HTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return server


def test_a_webhook_is_posted_again_until_it_is_taken():
    posts: list[dict] = []
    refuse = [True, True]

    class Handler(Quiet):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"]))
            if refuse:
                refuse.pop()
                self.send_response(503)
            else:
                posts.append(json.loads(body))
                self.send_response(200)
            self.end_headers()

    server = serving(Handler)
    board = Board()
    sink = WebhookSink(WebhookSettings(url=f"http://127.0.0.1:{server.server_port}/"), RETRY, board)
    sink.answer(answer(1))
    sink.answer(answer(2, alert=True))
    assert wait_until(lambda: len(posts) == 1)
    sink.close(1.0)
    server.shutdown()
    assert posts[0]["frame"] == 2
    assert posts[0]["alerts"][0]["type"] == "odometry_spoofing"
    assert board.sink("webhook") == Counter(failed=2, sent=1)


def test_a_webhook_that_redirects_is_a_failure_and_followed_nowhere(monkeypatch):
    monkeypatch.setenv("BELIE_WEBHOOK_TOKEN", "secret")
    asked: list[tuple[str, str]] = []

    class Handler(Quiet):
        def do_POST(self) -> None:
            self.rfile.read(int(self.headers["Content-Length"]))
            asked.append(("POST", self.path))
            self.send_response(302)
            self.send_header("Location", f"http://localhost:{server.server_port}/elsewhere")
            self.end_headers()

        def do_GET(self) -> None:
            asked.append(("GET", self.path))
            self.send_response(200)
            self.end_headers()

    server = serving(Handler)
    board = Board()
    sink = WebhookSink(WebhookSettings(url=f"http://127.0.0.1:{server.server_port}/hook"), RETRY, board)
    sink.answer(answer(2, alert=True))
    assert wait_until(lambda: board.sink("webhook")["failed"] >= 2)
    sink.close(1.0)
    server.shutdown()
    assert set(asked) == {("POST", "/hook")}
    assert board.sink("webhook")["sent"] == 0


def test_who_listens_is_told_the_object_of_an_alert():
    car = AccusedObject(label_before="car", label_after="bird", id_after="7", box_px=(1.0, 2.0, 30.0, 40.0))
    alert = Alert(type=AlertType.OBJECT_MISCLASSIFICATION, source=ODOM, onset_ns=5, object="7", accused=car)
    told = {pair.key: pair.value for pair in alert_status(3, alert).values}
    assert (told["object"], told["label_before"], told["label_after"]) == ("7", "car", "bird")
    assert told["box_px"] == "[1.0, 2.0, 30.0, 40.0]"
    board = Board()
    lie = CheckResult(check="misclassification", source=ODOM, status=Status.CONTRADICTED, object="7")
    raised = answer(3)
    verdict = replace(raised.verdict, checks=(lie,), alerts=(alert,))
    board.note(replace(raised, verdict=verdict))
    (error,) = state_of(board.picture(()), MqttSettings(), 0)["errors"]
    references = {one["referenceKey"]: one["referenceValue"] for one in error["errorReferences"]}
    assert (references["label_after"], references["box_px"]) == ("bird", "[1.0, 2.0, 30.0, 40.0]")


def test_a_webhook_wants_http():
    with pytest.raises(ConfigError, match="expected http"):
        WebhookSink(WebhookSettings(url="ftp://x"), RETRY, Board())


def test_metrics_are_served_and_a_taken_port_is_told():
    board = Board()
    board.note(answer(alert=True, status=Status.CONTRADICTED))
    board.fault(ODOM, "clock jump", "back by 3 s")
    inputs = (
        Input(
            topic=ODOM, message_type="", received=7, dropped=2, lost=1, age_s=0.5, rate_hz=10.0, silent=False
        ),
    )
    address = f"127.0.0.1:{free_port()}"
    sink = MetricsSink(address, lambda: board.picture(inputs))
    sink.answer(answer())
    with urllib.request.urlopen(f"http://{address}/metrics") as response:
        text = response.read().decode()
    with pytest.raises(TransportError, match="metrics"):
        MetricsSink(address, lambda: board.picture(inputs))
    sink.close(1.0)
    assert 'belie_frames_total{status="contradicted"} 1.0' in text
    assert 'belie_alerts_total{type="odometry_spoofing"} 1.0' in text
    assert 'belie_drops_total{topic="/odom"} 2.0' in text
    assert 'belie_input_age_seconds{topic="/odom"} 0.5' in text
    assert "belie_answer_latency_seconds_count 1.0" in text
    assert 'belie_faults_total{kind="clock jump",topic="/odom"} 1.0' in text


@pytest.mark.parametrize(("status", "level"), [("consistent", 0), ("undecided", 1), ("contradicted", 2)])
def test_levels_of_diagnostics(status, level):
    board = Board()
    board.note(answer(status=Status(status)))
    said = {one.name: one for one in statuses_of(board.picture(()))}["belie: odometry /odom"]
    values = {pair.key: pair.value for pair in said.values}
    assert said.level == level
    assert (values["statistic"], values["threshold"], values["floor"], values["source"]) == (
        "1",
        "9",
        "0.1 m",
        ODOM,
    )


def test_diagnostics_come_at_once_on_a_change_and_else_once_a_period():
    board, sent = Board(), []
    sink = DiagnosticsSink(sent.append, AnswerSettings(period_s=100.0), lambda: board.picture(()))
    for frame, status in enumerate((Status.CONSISTENT, Status.CONSISTENT, Status.CONTRADICTED)):
        sink.answer(answer(frame, status=status))
        sink.tick(board.picture(()))
    assert len(sent) == 2


def test_vda5050_names_what_is_wrong_now_and_no_more():
    board = Board()
    board.note(answer(1, alert=True, status=Status.CONTRADICTED))
    state = state_of(board.picture(()), MqttSettings(), 3)
    assert [(e["errorType"], e["errorLevel"]) for e in state["errors"]] == [("odometry_spoofing", "FATAL")]
    board.note(answer(2, status=Status.CONSISTENT))
    assert state_of(board.picture(()), MqttSettings(), 4)["errors"] == []


def test_annotated_images_are_rare_but_every_alert_is_shown():
    sent: list[bytes] = []
    sink = AnnotatedSink(sent.append, rate_hz=0.01)
    for frame in range(5):
        sink.answer(answer(frame, alert=frame == 3))
    assert len(sent) == 2


# -- evidence ----------------------------------------------------------------------------------------


def feed(sink: EvidenceSink, robot, first: int, count: int, start_ns: int) -> None:
    for k in range(first, first + count):
        at = start_ns + k * robot.period_ns
        for topic, kind, data in (
            (ODOM, ros.ODOMETRY, robot.odometry(k)),
            (INFO, ros.CAMERA_INFO, robot.info(k)),
            (IMAGE, ros.IMAGE, robot.image(k)),
        ):
            sink.received(Received(topic=topic, message_type=kind, data=data, received_ns=at))


def evidence(tmp_path, **settings) -> tuple[EvidenceSink, Board, list[str]]:
    board, events = Board(), []
    made = EvidenceSettings(folder=str(tmp_path), **settings)
    return EvidenceSink(made, (TF, INFO), board, events.append), board, events


def test_evidence_holds_the_seconds_around_the_alert_and_can_be_checked(robot, tmp_path):
    sink, board, _ = evidence(tmp_path, before_s=1.0, after_s=30.0)
    start = now_ns() - 4_000_000_000
    sink.received(Received(topic=TF, message_type=ros.TRANSFORMS, data=robot.tf(), received_ns=start))
    feed(sink, robot, 0, 60, start)  # three seconds, of which one is kept
    sink.answer(answer(59, alert=True))
    feed(sink, robot, 60, 20, start)
    assert not list(tmp_path.glob("*.mcap")), "not before it is whole"
    began = time.monotonic()
    sink.close(2.0)
    assert time.monotonic() - began < 2.0
    (bag,) = tmp_path.glob("*.mcap")
    assert "odometry_spoofing" in bag.name
    assert board.sink("evidence")["sent"] == 1
    stamps = [step.frame.stamp_ns for step in open_recording(bag).steps()]
    assert stamps[-1] == 79 * robot.period_ns
    assert stamps[0] == pytest.approx(39 * robot.period_ns, abs=robot.period_ns)
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


def test_evidence_keeps_its_quota_and_its_memory(robot, tmp_path):
    sink, _, events = evidence(tmp_path, before_s=100.0, after_s=0.0, quota_mb=3.0, memory_mb=2.0)
    for turn in range(3):
        feed(sink, robot, 100 * turn, 50, now_ns())
        sink.answer(answer(turn, alert=True))
        time.sleep(0.01)
        sink.tick(Board().picture(()))
        assert wait_until(lambda turn=turn: len(events) == turn + 1)
    sink.close(2.0)
    sizes = [bag.stat().st_size for bag in tmp_path.glob("*.mcap")]
    assert sum(sizes) < 3.0e6 * 1.1
    assert max(sizes) < 2.0e6 * 1.2
    assert any("quota" in event for event in events)


def test_alerts_in_quick_succession_keep_a_bag_each(robot, tmp_path, monkeypatch):
    began, may_go_on = threading.Event(), threading.Event()

    class SlowBag(EvidenceBag):
        def __init__(self, *arguments) -> None:
            began.set()
            may_go_on.wait(10.0)
            super().__init__(*arguments)

    monkeypatch.setattr("belie.bridges.sinks.evidence.EvidenceBag", SlowBag)
    sink, board, _ = evidence(tmp_path, before_s=1.0, after_s=0.0)
    sink.received(Received(topic=TF, message_type=ros.TRANSFORMS, data=robot.tf(), received_ns=now_ns()))
    for turn in range(3):  # the first holds the disk up, so that the others lie in one batch
        feed(sink, robot, 10 * turn, 5, now_ns())
        sink.answer(answer(turn, alert=True))
        time.sleep(0.005)
        sink.tick(Board().picture(()))
        assert began.wait(5.0)
    may_go_on.set()
    sink.close(5.0)
    assert board.sink("evidence") == Counter(sent=3)
    bags = sorted(tmp_path.glob("*.mcap"))
    first = [next(iter(open_recording(bag).steps())).frame.stamp_ns // robot.period_ns for bag in bags]
    assert first == [0, 10, 20]


def test_evidence_on_a_disk_that_fails_is_a_fault_and_no_end(robot, tmp_path):
    target = tmp_path / "file"
    target.write_text("no folder")
    sink, board, _ = evidence(target, before_s=1.0, after_s=0.0)
    feed(sink, robot, 0, 5, now_ns())
    sink.answer(answer(1, alert=True))
    sink.tick(Board().picture(()))
    sink.close(2.0)
    assert any(fault.kind == "evidence not written" for fault in board.faults())


def test_evidence_gives_a_bag_up_at_its_first_error_and_writes_the_next(robot, tmp_path, monkeypatch):
    failing = threading.Event()
    failing.set()
    write = EvidenceBag.write

    def fail(bag: EvidenceBag, message: Received) -> None:
        if failing.is_set() and message.topic == IMAGE:
            raise OSError("no space left on device")
        write(bag, message)

    monkeypatch.setattr(EvidenceBag, "write", fail)
    sink, board, _ = evidence(tmp_path, before_s=1.0, after_s=0.05)
    sink.answer(answer(0, alert=True))
    for turn in range(4):  # batch after batch, all of the bag that failed
        feed(sink, robot, turn, 1, now_ns())
        assert wait_until(lambda: not sink._queue)
    time.sleep(0.06)
    sink.tick(Board().picture(()))
    assert wait_until(lambda: not list(tmp_path.iterdir())), "no scratch folder stays"
    assert board.sink("evidence") == Counter(failed=1)
    failing.clear()
    feed(sink, robot, 10, 5, now_ns())
    sink.answer(answer(1, alert=True))
    sink.close(5.0)
    assert board.sink("evidence") == Counter(failed=1, sent=1)
    assert [path.suffix for path in tmp_path.iterdir()] == [".mcap"]
