"""Recording to attacked recording with labels: pure, seeded transformations of streams.

>>> parse_attack("paper-odometry:start=40").to_text()
'paper-odometry:start=40'
"""

from belie.attacks.attacked import AttackedRecording, attack
from belie.attacks.describe import describe_attacks
from belie.attacks.labels import AttackLabel, labels_path, read_labels, write_labels
from belie.attacks.source import Source
from belie.attacks.spec import AttackSpec, parse_attack
from belie.attacks.timing import Timing

__all__ = [
    "AttackLabel",
    "AttackSpec",
    "AttackedRecording",
    "Source",
    "Timing",
    "attack",
    "describe_attacks",
    "labels_path",
    "parse_attack",
    "read_labels",
    "write_labels",
]
