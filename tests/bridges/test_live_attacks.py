"""The paper's attacks on objects, tried on a running robot: three processes of belie over DDS on loopback."""

from __future__ import annotations

import pytest
from live_tools import watch_under_attack

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("spec", "alert", "domain_offset"),
    [
        ("paper-hiding:object=1,start=30", "obstacle_hiding", 4),
        ("paper-misclassification:object=1,start=30", "object_misclassification", 5),
    ],
)
def test_an_object_attacked_for_ten_messages_is_named(start, tmp_path, spec, alert, domain_offset):
    topic = "/detections_attacked"
    alerts, hijack = watch_under_attack(start, tmp_path, spec, "--detections", topic, domain_offset)
    assert "stop: 10 messages altered" in hijack.said(), hijack.said()
    assert [(a["type"], a["source"], a["object"]) for a in alerts] == [(alert, topic, "1")]
