"""From a name to a detector: belie's profiles, the rivals in the package, and ``module:Class`` of a user's own."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from belie.detector import Config
from belie.evaluation.bench.cache import content_key
from belie.evaluation.bench.rivals.belie_rival import BelieRival
from belie.evaluation.bench.rivals.protocol import Cameras, Rival, judges
from belie.evaluation.bench.rivals.remembered import Sight
from belie.types import AlertType, ConfigError

_PROFILES = ("default", "paper")
_HERE = "belie.evaluation.bench.rivals"
_SHIPPED = {
    "gate": f"{_HERE}.gate:InnovationGate",
    "mahalanobis": f"{_HERE}.gate:MahalanobisGate",
    "boxes": f"{_HERE}.boxes:BoxClassifier",
    "objectness": f"{_HERE}.objectness:Objectness",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class RivalMaker:
    """How a detector is made for a recording.

    Parameters
    ----------
    name : str
        As in the suite.
    key : str
        Names its settings and code: another key, another outcome.
    judges : frozenset of AlertType
        The types of alert that it can raise.
    make : callable
        From cameras to the detector.
    config : Config or None
        Of belie's own profiles.
    """

    name: str
    key: str
    judges: frozenset[AlertType]
    make: Callable[[Cameras], Rival]
    config: Config | None = None

    def remembering(self, cameras: Cameras, sights: list[Sight] | None) -> Rival:
        """The detector, with what an earlier run over the same images saw, where it can use it."""
        if self.config is None or self.config.profile != "default":
            return self.make(cameras)
        return BelieRival(cameras, self.config, sights=sights)


def rival_maker(name: str, config: Config | None = None) -> RivalMaker:
    """The detector of that name.

    Parameters
    ----------
    name : str
        ``default``, ``paper``, one of the rivals in the package, or ``module:Class``.
    config : Config, optional
        Settings of belie's own profiles; the profile itself is as named.

    Raises
    ------
    ConfigError
        On an unknown name, or a class that cannot be imported or has no `update`.

    Examples
    --------
    >>> rival_maker("default").config.profile
    'default'
    >>> rival_maker("defalt")
    Traceback (most recent call last):
        ...
    belie.types.errors.ConfigError: no rival defalt: known are default, paper, gate, mahalanobis, boxes, objectness, \
or module:Class of your own
    """
    if name in _PROFILES:
        chosen = (config or Config()).model_copy(update={"profile": name})
        return RivalMaker(
            name=name,
            key=content_key(chosen.model_dump(mode="json")),
            judges=frozenset(AlertType),
            make=lambda cameras: BelieRival(cameras, chosen),
            config=chosen,
        )
    if name not in _SHIPPED and ":" not in name:
        known = ", ".join((*_PROFILES, *_SHIPPED))
        raise ConfigError(f"no rival {name}: known are {known}, or module:Class of your own")
    kind = _class(_SHIPPED.get(name, name))
    return RivalMaker(name=name, key=_source_key(kind), judges=judges(kind), make=kind)


def _class(path: str) -> Any:
    module, _, name = path.partition(":")
    try:
        kind = getattr(import_module(module), name)
    except (ImportError, AttributeError) as error:
        raise ConfigError(
            f"rival {path}: {error}; write module:Class, and put the module's folder in PYTHONPATH"
        ) from None
    if not (inspect.isclass(kind) and callable(getattr(kind, "update", None))):
        raise ConfigError(f"rival {path} is no class with a method update(step)")
    try:
        inspect.signature(kind).bind({})
    except TypeError:
        raise ConfigError(
            f"rival {path} is made with the cameras: write def __init__(self, cameras)"
        ) from None
    return kind


def _source_key(kind: type) -> str:
    """Of the file that a class stands in, and of what lies beside it under its name (weights)."""
    source = inspect.getsourcefile(kind)
    if source is None:
        return content_key(kind.__qualname__)
    digest = hashlib.sha256()
    for file in sorted(Path(source).parent.glob(f"{Path(source).stem}.*")):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:20]
