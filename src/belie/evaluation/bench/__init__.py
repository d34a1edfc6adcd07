"""The benchmark: recordings x attacks x detectors, measured by one rule; see docs/benchmark.md."""

from belie.evaluation.bench.suite import Suite, load_suite, shipped_suites, suite_text

__all__ = ["Suite", "load_suite", "shipped_suites", "suite_text"]
