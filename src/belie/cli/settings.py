"""From flags to the one settings tree."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from belie.detector import Config


def config_from_flags(
    config: Path | None, profile: str | None, false_alarms_per_hour: float | None = None
) -> Config:
    """The settings of a file (or the defaults), with what the flags say instead.

    Raises
    ------
    ConfigError
        On an unknown setting or a value out of range.

    Examples
    --------
    >>> config_from_flags(None, "paper", 2.0).sequential.false_alarms_per_hour
    2.0
    """
    from belie.detector import Config, load_config, parse_config

    base = Config() if config is None else load_config(config)
    if profile is None and false_alarms_per_hour is None:
        return base
    values = base.model_dump()
    if profile is not None:
        values["profile"] = profile
    if false_alarms_per_hour is not None:
        values["sequential"]["false_alarms_per_hour"] = false_alarms_per_hour
    return parse_config(values, "command line")
