"""`Detector(cameras, config).update(frame, claims) -> Verdict`: the one public entry."""

from belie.detector.config import Config, load_config, parse_config
from belie.detector.detector import Detector

__all__ = ["Config", "Detector", "load_config", "parse_config"]
