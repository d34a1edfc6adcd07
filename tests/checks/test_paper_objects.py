import pytest

from belie.checks import PaperThresholds
from belie.checks.paper_objects import hiding_check, misclassification_check
from belie.types import Status

SETTINGS = PaperThresholds()


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (0.0, Status.CONTRADICTED),
        (19.9, Status.CONTRADICTED),
        (20.0, Status.CONSISTENT),
        (float("inf"), Status.CONSISTENT),
        (None, Status.UNDECIDED),
    ],
)
def test_an_error_below_t4_accuses_and_nothing_else_does(error, status):
    why = "" if error is not None else "2 pairs"
    hiding = hiding_check("/d", "7", "car", error, why, SETTINGS)
    naming = misclassification_check("/d", "7", "car", "bird", error, why, SETTINGS)
    assert (hiding.status, naming.status) == (status, status)
    assert (hiding.check, naming.check) == ("hiding", "misclassification")
    assert (hiding.statistic, hiding.threshold, hiding.unit, hiding.object) == (error, 20.0, "px2", "7")
    assert why in hiding.reason
