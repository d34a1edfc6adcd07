"""Checks of object detections, section III-C: hiding, misclassification, injection."""

from belie.checks.objects.class_groups import ClassGroups
from belie.checks.objects.cover import CoverHabit
from belie.checks.objects.habits import (
    Counts,
    ErrorTest,
    Habit,
    lasts_of_small,
    run_threshold,
)
from belie.checks.objects.injection import PhantomTest, background_evidence, passing_evidence
from belie.checks.objects.settings import ObjectSettings
from belie.checks.objects.shares import shared_thresholds

__all__ = [
    "ClassGroups",
    "Counts",
    "CoverHabit",
    "ErrorTest",
    "Habit",
    "ObjectSettings",
    "PhantomTest",
    "background_evidence",
    "lasts_of_small",
    "passing_evidence",
    "run_threshold",
    "shared_thresholds",
]
