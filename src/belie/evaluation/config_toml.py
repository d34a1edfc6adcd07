"""Settings as TOML that explains itself: every value with its unit and meaning, as `load_config` reads it."""

from __future__ import annotations

import json
import math
import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

from belie.types import Settings

_WIDTH = 100


def to_toml(settings: Settings, *, notes: Mapping[str, str] | None = None, header: str = "") -> str:
    """Write settings as TOML, each under a comment with its meaning, its unit and (if changed) its default.

    Parameters
    ----------
    settings : Settings
        A group, or a tree of groups.
    notes : mapping, optional
        More lines of comment for single settings, by dotted name.
    header : str
        Comment on top.

    Examples
    --------
    >>> from pydantic import Field
    >>> class Gate(Settings):
    ...     width_m: float = Field(0.5, description="how far is too far [m]")
    >>> class Tree(Settings):
    ...     profile: str = Field("default", description="which one")
    ...     gate: Gate = Gate()
    >>> print(to_toml(Tree(gate=Gate(width_m=0.25))))
    # which one
    profile = "default"
    <BLANKLINE>
    [gate]
    # how far is too far [m]
    # default: 0.5
    width_m = 0.25
    <BLANKLINE>
    """
    lines = [*_comment(header)]
    if header:
        lines.append("")
    lines += _table(settings, (), notes or {})
    return "\n".join(lines).lstrip("\n") + "\n"


def changed_settings(settings: Settings, prefix: str = "") -> dict[str, tuple[Any, Any]]:
    """Value and default of every setting that differs from its default, by dotted name.

    >>> changed_settings(Settings())
    {}
    """
    changed: dict[str, tuple[Any, Any]] = {}
    for name, field in type(settings).model_fields.items():
        value = getattr(settings, name)
        default = field.get_default(call_default_factory=True)
        if isinstance(value, Settings):
            changed.update(changed_settings(value, f"{prefix}{name}."))
        elif value != default:
            changed[f"{prefix}{name}"] = (value, default)
    return changed


def _table(settings: Settings, path: tuple[str, ...], notes: Mapping[str, str]) -> Iterator[str]:
    fields = type(settings).model_fields
    groups = [name for name in fields if isinstance(getattr(settings, name), Settings)]
    if path and len(groups) < len(fields):
        yield ""
        yield f"[{'.'.join(path)}]"
        yield from _comment((type(settings).__doc__ or "").strip().split("\n")[0])
    for name, field in fields.items():
        if name in groups:
            continue
        value = getattr(settings, name)
        default = value if field.is_required() else field.get_default(call_default_factory=True)
        yield from _comment(field.description or "")
        if value != default:
            yield from _comment(f"default: {toml_value(default)}")
        yield from _comment(notes.get(".".join((*path, name)), ""))
        # TOML has no null: a setting without a value is left out.
        yield f"# {name} is not set" if value is None else f"{name} = {toml_value(value)}"
    for name in groups:
        yield from _table(getattr(settings, name), (*path, name), notes)


def _comment(text: str) -> list[str]:
    return [
        f"# {line}".rstrip()
        for part in text.splitlines()
        for line in textwrap.wrap(part, _WIDTH - 2, break_long_words=False) or [""]
    ]


def toml_value(value: Any) -> str:
    """A value as TOML writes it.

    >>> toml_value((1, 2.5, "x"))
    '[1, 2.5, "x"]'
    """
    if value is None:
        return "not set"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return _float(value)
    if isinstance(value, list | tuple):
        return f"[{', '.join(toml_value(item) for item in value)}]"
    if isinstance(value, dict):  # an inline table: TOML allows it no line breaks
        return f"{{{', '.join(f'{json.dumps(key)} = {toml_value(item)}' for key, item in value.items())}}}"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    return str(value)


def _float(value: float) -> str:
    if math.isnan(value) or math.isinf(value):
        return str(value)
    return repr(value)
