"""``belie calibrate``."""

def calibrate() -> None:
    """Later."""
