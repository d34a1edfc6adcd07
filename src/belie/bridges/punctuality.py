"""Which streams are worth waiting for: those whose claim for a frame usually comes within the patience."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

_FOLLOW = 0.1  # share of the newest frame in the running mean: about ten frames of memory
_WORTH_IT = 0.5  # a frame waits for a stream that comes in time more often than not
_PENDING = 64


@dataclass(slots=True)
class _Record:
    share: float = 1.0
    open: deque[tuple[int, int]] = field(default_factory=lambda: deque(maxlen=_PENDING))


class Punctuality:
    """For each stream, the share of frames whose claim came within the patience.

    A slow stream (GNSS at 1 Hz) or a late one (a detector that needs 80 ms) would delay every frame by the whole
    patience and still miss it; its claims travel with a later frame instead, and are judged at their own stamps.

    Examples
    --------
    >>> punctuality = Punctuality(patience_ns=40)
    >>> for k in range(10):
    ...     punctuality.frame(stamp_ns=1000 * k, received_ns=1000 * k, streams=["/late", "/soon"])
    ...     punctuality.claim("/soon", stamp_ns=1000 * k, received_ns=1000 * k + 5)
    ...     punctuality.claim("/late", stamp_ns=1000 * k, received_ns=1000 * k + 500)
    >>> punctuality.unpunctual()
    {'/late'}
    """

    def __init__(self, patience_ns: int) -> None:
        self.patience_ns = patience_ns
        self._records: dict[str, _Record] = {}

    def frame(self, *, stamp_ns: int, received_ns: int, streams: list[str]) -> None:
        """Note a frame that claims of `streams` are expected for."""
        for source in streams:
            record = self._records.setdefault(source, _Record())
            if record.open and received_ns - record.open[0][1] > 10 * self.patience_ns:
                self._note(record, False)  # silent: waiting is in vain
                record.open.popleft()
            record.open.append((stamp_ns, received_ns))

    def claim(self, source: str, *, stamp_ns: int, received_ns: int) -> None:
        """Note a claim: it answers every frame up to its stamp."""
        record = self._records.setdefault(source, _Record())
        while record.open and record.open[0][0] <= stamp_ns:
            _, frame_received_ns = record.open.popleft()
            self._note(record, received_ns - frame_received_ns <= self.patience_ns)

    def _note(self, record: _Record, in_time: bool) -> None:
        record.share += _FOLLOW * (float(in_time) - record.share)

    def unpunctual(self) -> set[str]:
        """The sources that no frame should wait for."""
        return {source for source, record in self._records.items() if record.share < _WORTH_IT}
