"""Verdicts as JSON lines: the contract of ``belie check --json`` (design, section 4)."""

from __future__ import annotations

import json
import math
from typing import Any

from belie.types.verdict import Verdict


def json_line(verdict: Verdict) -> str:
    """One verdict as one line; what is not finite becomes null, for JSON has no infinity.

    >>> from belie.types import Status
    >>> json_line(Verdict(frame=1, stamp_ns=2, status=Status.CONSISTENT, latency_ms=3.0))
    '{"frame": 1, "stamp_ns": 2, "status": "consistent", "latency_ms": 3.0, "checks": [], "alerts": []}'
    """
    return json.dumps(_finite(verdict.to_json()), ensure_ascii=False, allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_finite(entry) for entry in value]
    return value
