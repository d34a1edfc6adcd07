"""`Detector(cameras, config).update(frame, claims) -> Verdict`: the one public entry."""

from belie.detector.config import Config, load_config, parse_config
from belie.detector.detector import Detector
from belie.detector.object_view import ObjectView

__all__ = ["Config", "Detector", "ObjectView", "load_config", "parse_config"]
