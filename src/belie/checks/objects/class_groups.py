"""Which labels mean the same to a planner: a van taken for a lorry is noise, a car taken for a bird is none."""

from __future__ import annotations

from pydantic import Field

from belie.types import Settings

_GROUPS: dict[str, tuple[str, ...]] = {
    # names of KITTI, COCO, nuScenes and Apollo; spelling, spaces and case do not matter
    "vehicle": (
        "car", "van", "truck", "bus", "tram", "train", "vehicle", "trailer", "suv", "pickup", "lorry", "taxi",
        "construction_vehicle", "emergency_vehicle", "ambulance", "police", "unknown_movable", "misc",
        "vehicle.car", "vehicle.truck", "vehicle.bus.rigid", "vehicle.bus.bendy", "vehicle.trailer",
        "vehicle.construction", "vehicle.emergency.ambulance", "vehicle.emergency.police",
    ),
    "person": (
        "person", "pedestrian", "person_sitting", "cyclist", "bicyclist", "rider", "motorcyclist", "bicycle",
        "motorcycle", "motorbike", "bike", "tricyclist", "scooter", "human.pedestrian.adult",
        "human.pedestrian.child", "human.pedestrian.construction_worker", "human.pedestrian.police_officer",
        "vehicle.bicycle", "vehicle.motorcycle",
    ),
    "traffic_light": ("traffic_light", "traffic_light_red", "traffic_light_green", "traffic_light_yellow"),
    "barrier": (
        "barrier", "traffic_cone", "cone", "movable_object.barrier", "movable_object.trafficcone",
        "unknown_unmovable",
    ),
}  # fmt: skip


class ClassGroups(Settings):
    """Labels that a detector may confuse without lying.

    Examples
    --------
    >>> groups = ClassGroups()
    >>> groups.of("Car") == groups.of("vehicle.bus.rigid"), groups.of("car") == groups.of("bird")
    (True, False)
    """

    groups: dict[str, tuple[str, ...]] = Field(
        _GROUPS,
        description="groups of labels; a label that is in none is a group of its own. People on two wheels are one "
        "group with people on foot: detectors name now the rider, now the machine",
    )

    def of(self, label: str) -> str:
        """The group of a label."""
        name = label.strip().lower().replace(" ", "_").replace("-", "_")
        for group, labels in self.groups.items():
            if name == group or name in labels:
                return group
        return name
