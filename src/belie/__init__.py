"""belie: checks what a robot claims against what its camera sees, and names the claim that is a lie.

>>> import belie
>>> sorted(belie.__all__)
['Alert', 'BelieError', 'Config', 'Detector', 'Verdict', 'attacks', 'open_recording', 'write_report']
"""

from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

__all__ = [
    "Alert",
    "BelieError",
    "Config",
    "Detector",
    "Verdict",
    "attacks",
    "open_recording",
    "write_report",
]

if TYPE_CHECKING:
    from belie import attacks
    from belie.detector import Config, Detector
    from belie.evaluation import write_report
    from belie.recordings import open_recording
    from belie.types import Alert, BelieError, Verdict

_HOME = {
    "Alert": "belie.types",
    "BelieError": "belie.types",
    "Config": "belie.detector",
    "Detector": "belie.detector",
    "Verdict": "belie.types",
    "open_recording": "belie.recordings",
    "write_report": "belie.evaluation",
}


def __getattr__(name: str) -> Any:
    # Imported on first use: `belie --help` must not wait for numba and OpenCV.
    import importlib

    if name == "attacks":
        return importlib.import_module("belie.attacks")
    if name in _HOME:
        return getattr(importlib.import_module(_HOME[name]), name)
    raise AttributeError(f"module 'belie' has no attribute {name!r}")
