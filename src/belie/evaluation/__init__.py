"""Runs, scores, calibration and the report: what a detector did, in numbers, figures and words."""

from belie.evaluation.report import write_report
from belie.evaluation.run import Run, run_detector
from belie.evaluation.score import Score, pool_scores

__all__ = ["Run", "Score", "pool_scores", "run_detector", "write_report"]
