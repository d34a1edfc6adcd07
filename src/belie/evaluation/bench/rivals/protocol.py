"""What the benchmark asks of a detector: one method. A user's own plugs in as ``--rival module:Class``.

::

    class Mine:
        def __init__(self, cameras):            # mapping of camera name to belie.types.MountedCamera
            ...

        def update(self, step):                 # belie.types.Step: one frame and the claims that came with it
            return []                           # belie.types.Alert, each once, in the frame in which it is raised

The rest is optional, and tells the tables more: `checks` (the `CheckResult` of the last frame, whose statistics over
thresholds make the curves), `status` (its answer to the last frame), and `judges` (the types of alert that it can raise
at all; attacks of other types are then not held against it).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Protocol, runtime_checkable

from belie.types import Alert, AlertType, CheckResult, MountedCamera, Status, Step

Cameras = Mapping[str, MountedCamera]


class RivalError(TypeError):
    """What a detector gave is not what is asked of it; the message says what is."""


@runtime_checkable
class Rival(Protocol):
    """A detector as the benchmark sees it.

    Examples
    --------
    >>> class Silent:
    ...     def update(self, step):
    ...         return []
    >>> isinstance(Silent(), Rival)
    True
    """

    def update(self, step: Step) -> Iterable[Alert]:
        """Judge one frame and the claims that came with it; the alerts raised now."""
        ...


def checks_of(rival: Rival) -> tuple[CheckResult, ...]:
    """What it says of the last frame, if it says more than alerts."""
    return tuple(getattr(rival, "checks", ()))


def status_of(rival: Rival, alerts: Iterable[Alert]) -> Status:
    """Its answer to the last frame: as it says, or as its checks and alerts come to.

    >>> class Silent:
    ...     def update(self, step):
    ...         return []
    >>> status_of(Silent(), []).value
    'consistent'
    """
    said = getattr(rival, "status", None)
    if isinstance(said, Status):
        return said
    statuses = {check.status for check in checks_of(rival)}
    if Status.CONTRADICTED in statuses or any(True for _ in alerts):
        return Status.CONTRADICTED
    return Status.UNDECIDED if statuses == {Status.UNDECIDED} else Status.CONSISTENT


def judges(rival_or_class: object) -> frozenset[AlertType]:
    """The types of alert that it can raise; all of them where it does not say.

    >>> len(judges(object())) == len(AlertType)
    True
    """
    return frozenset(getattr(rival_or_class, "judges", AlertType))
