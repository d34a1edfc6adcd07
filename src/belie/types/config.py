"""The base of every stage's settings: frozen, typed, documented, unknown keys refused."""

from __future__ import annotations

from typing import Any, Self

from pydantic import BaseModel, ConfigDict, ValidationError

from belie.types.errors import ConfigError


class Settings(BaseModel):
    """A frozen group of settings; each field states its unit and meaning in its description.

    >>> Settings.model_config["extra"]
    'forbid'
    """

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)

    @classmethod
    def checked(cls, values: dict[str, Any], origin: str) -> Self:
        """Settings from plain values, as TOML gives them.

        Raises
        ------
        ConfigError
            On an unknown key or a value out of range; the line names `origin` and the key.

        Examples
        --------
        >>> Settings.checked({"speed": 1}, "belie.toml")
        Traceback (most recent call last):
            ...
        belie.types.errors.ConfigError: belie.toml: speed: Extra inputs are not permitted
        """
        try:
            return cls.model_validate(values)
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(str(part) for part in first["loc"])
            raise ConfigError(f"{origin}: {where}: {first['msg']}") from None
