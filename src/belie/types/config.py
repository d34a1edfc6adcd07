"""The base of every stage's settings: frozen, typed, documented, unknown keys refused."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class Settings(BaseModel):
    """A frozen group of settings; each field states its unit and meaning in its description.

    >>> Settings.model_config["extra"]
    'forbid'
    """

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)
