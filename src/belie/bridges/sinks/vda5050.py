"""Alerts and faults as the ``state`` message of VDA 5050 (version 2)."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from belie.bridges.board import Picture
from belie.bridges.settings import MqttSettings
from belie.types import Alert, Status

VERSION = "2.0.0"


def topic_of(settings: MqttSettings) -> str:
    """``interface/v2/manufacturer/serialNumber/state``.

    >>> topic_of(MqttSettings(serial="cart7"))
    'belie/v2/belie/cart7/state'
    """
    return f"{settings.interface}/v2/{settings.manufacturer}/{settings.serial}/state"


def state_of(picture: Picture, settings: MqttSettings, header_id: int) -> dict[str, Any]:
    """The state: the alerts of streams that are still contradicted are FATAL, faults of inputs are WARNING.

    belie is a monitor and no vehicle: fields of a vehicle that the schema asks for are empty or neutral, which
    is why it reports under its own name, beside the vehicle's.
    """
    contradicted: set[tuple[str, str | None]] = set()
    if picture.answer is not None:
        contradicted = {
            (check.source, check.object)
            for check in picture.answer.verdict.checks
            if check.status is Status.CONTRADICTED
        }
    latest = {(alert.type, alert.source, alert.object): alert for _, alert in picture.alerts}
    errors = [_error(alert) for alert in latest.values() if (alert.source, alert.object) in contradicted]
    errors += [
        {
            "errorType": fault.kind.replace(" ", "_"),
            "errorLevel": "WARNING",
            "errorDescription": f"{fault.topic or 'belie'}: {fault.text}",
            "errorReferences": [{"referenceKey": "topic", "referenceValue": fault.topic or "belie"}],
        }
        for fault in picture.recent_faults()
    ]
    moment = datetime.now(tz=UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
    return {
        "headerId": header_id,
        "timestamp": moment,
        "version": VERSION,
        "manufacturer": settings.manufacturer,
        "serialNumber": settings.serial,
        "orderId": "",
        "orderUpdateId": 0,
        "lastNodeId": "",
        "lastNodeSequenceId": 0,
        "driving": False,
        "operatingMode": "SERVICE",
        "nodeStates": [],
        "edgeStates": [],
        "actionStates": [],
        "batteryState": {"batteryCharge": 0.0, "charging": False},
        "safetyState": {"eStop": "NONE", "fieldViolation": False},
        "errors": errors,
        "information": [{"infoType": "belie_state", "infoLevel": "INFO", "infoDescription": picture.state}],
    }


def _error(alert: Alert) -> dict[str, Any]:
    references = [
        {"referenceKey": "source", "referenceValue": alert.source},
        {"referenceKey": "onset_ns", "referenceValue": str(alert.onset_ns)},
    ]
    if alert.object:
        references.append({"referenceKey": "object", "referenceValue": alert.object})
    if alert.accused is not None:
        told = {name: value for name, value in alert.accused.to_json().items() if value is not None}
        references += [{"referenceKey": name, "referenceValue": str(value)} for name, value in told.items()]
    return {
        "errorType": alert.type.value,
        "errorLevel": "FATAL",
        "errorDescription": f"the camera contradicts {alert.source}",
        "errorReferences": references,
    }
