"""The base of every stage's settings: frozen, typed, documented, unknown keys refused."""

from __future__ import annotations

from typing import Any, Self, TypeGuard

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
            text = f"{origin}: {where}: {first['msg']}"
            if first["type"] != "extra_forbidden":
                raise ConfigError(text) from None
            known = _known_instead(cls, first["loc"])
            raise ConfigError(text, in_words=f"{origin}: {where}: no such setting; {known}") from None


def _known_instead(settings: type[BaseModel], where: tuple[str | int, ...]) -> str:
    """Which setting may be meant by one that is unknown: of its own group first, of all else; otherwise its group's."""
    from difflib import get_close_matches

    group: Any = settings
    *path, name = where
    for step in path:
        field = group.model_fields.get(str(step)) if _is_group(group) else None
        group = None if field is None else field.annotation
    own = list(group.model_fields) if _is_group(group) else []
    if near := get_close_matches(str(name), own, n=1):
        return f"did you mean {'.'.join(map(str, (*path, *near)))}?"
    names = _names(settings)
    if near := get_close_matches(str(name), [each.rpartition(".")[2] for each in names], n=1):
        return f"did you mean {' or '.join(each for each in names if f'.{each}'.endswith(f'.{near[0]}'))}?"
    return f"known here are {', '.join(own)}" if own else "leave it out"


def _names(settings: type[BaseModel], within: str = "") -> list[str]:
    """Dotted names of all settings and their groups."""
    found = []
    for name, field in settings.model_fields.items():
        found.append(f"{within}{name}")
        if _is_group(field.annotation):
            found += _names(field.annotation, f"{within}{name}.")
    return found


def _is_group(annotation: Any) -> TypeGuard[type[BaseModel]]:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)
