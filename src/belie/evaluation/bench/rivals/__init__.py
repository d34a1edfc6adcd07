"""The detectors that are compared, by name; see `protocol` for how to add one's own."""

from belie.evaluation.bench.rivals.protocol import Cameras, Rival, RivalError, checks_of, judges, status_of
from belie.evaluation.bench.rivals.registry import RivalMaker, rival_maker

__all__ = ["Cameras", "Rival", "RivalError", "RivalMaker", "checks_of", "judges", "rival_maker", "status_of"]
