"""Recording to attacked recording with labels: pure, seeded transformations of streams.

>>> parse_attack("paper-odometry:start=40").to_text()
'paper-odometry:start=40'
"""

from belie.attacks.attacked import AttackedRecording, attack
from belie.attacks.describe import describe_attacks
from belie.attacks.labels import AttackLabel, labels_path, read_labels, write_labels
from belie.attacks.running import RunningAttack, attacked_streams
from belie.attacks.source import Source
from belie.attacks.spec import AttackSpec, parse_attack
from belie.attacks.staying import Choice, StayingObject, choose_objects, staying_objects
from belie.attacks.timing import FrameClock, Timing

__all__ = [
    "AttackLabel",
    "AttackSpec",
    "AttackedRecording",
    "Choice",
    "FrameClock",
    "RunningAttack",
    "Source",
    "StayingObject",
    "Timing",
    "attack",
    "attacked_streams",
    "choose_objects",
    "describe_attacks",
    "labels_path",
    "parse_attack",
    "read_labels",
    "staying_objects",
    "write_labels",
]
