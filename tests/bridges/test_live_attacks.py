"""The paper's attacks on objects, tried on a running robot: three processes of belie over DDS on loopback."""

from __future__ import annotations

import json
import os
import signal

import pytest
from live_tools import BELIE, DEMO, LIKE_CHECK, wait_until

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("spec", "alert", "domain_offset"),
    [
        ("paper-hiding:object=1,start=30", "obstacle_hiding", 4),
        ("paper-misclassification:object=1,start=30", "object_misclassification", 5),
    ],
)
def test_an_object_attacked_for_ten_messages_is_named(start, tmp_path, spec, alert, domain_offset):
    network = ["--domain", str(100 + (os.getpid() + domain_offset) % 100), "--interface", "lo"]
    config = tmp_path / "live.toml"
    config.write_text(LIKE_CHECK + "[dds]\nreliable = true\n")
    flags = [*network, "--config", str(config)]
    out = tmp_path / "live.jsonl"
    hijack = start([*BELIE, "attack", "--live", "dds", spec, *flags], "attack")
    topic = "/detections_attacked"
    live = start([*BELIE, "live", "dds", *flags, "--json", str(out), "--detections", topic], "live")
    live.wait_for("waiting")
    play = start([*BELIE, "play", str(DEMO), "dds", *network, "--wait", "2"], "play")
    play.wait_for("played")
    assert wait_until(lambda: len(out.read_text().splitlines()) == 120), live.said()
    assert live.stop(signal.SIGINT) == 1, live.said()
    hijack.stop(signal.SIGINT)
    assert "stop: 10 messages altered" in hijack.said(), hijack.said()
    alerts = [a for line in out.read_text().splitlines() for a in json.loads(line)["alerts"]]
    assert [(a["type"], a["source"], a["object"]) for a in alerts] == [(alert, topic, "1")]
