"""One evidence bag on disk: written under a hidden name, renamed when it is whole; and the quota of its folder."""

from __future__ import annotations

import os
import shutil
import tempfile
from contextlib import suppress
from pathlib import Path

from rosbags.interfaces import Connection
from rosbags.rosbag2 import StoragePlugin, Writer

from belie.bridges.wire import Received
from belie.recordings.messages import STORE
from belie.recordings.writer import LATCHED

PREFIX = "belie-evidence-"


class EvidenceBag:
    """An MCAP that grows; `close` gives it its name.

    Parameters
    ----------
    folder : Path
        Where it will lie.
    name : str
        Its name, without ``.mcap``.
    """

    def __init__(self, folder: Path, name: str) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.path = folder / f"{name}.mcap"
        self.bytes = 0
        self._scratch = Path(tempfile.mkdtemp(dir=folder, prefix=f".{name}-"))
        self._bag = Writer(self._scratch / name, version=9, storage_plugin=StoragePlugin.MCAP)
        self._connections: dict[str, Connection] = {}
        try:
            self._bag.open()
        except Exception:
            self.abandon()
            raise

    def write(self, message: Received) -> None:
        """Append a message as it was received."""
        connection = self._connections.get(message.topic)
        if connection is None:
            latched = [LATCHED] if message.topic == "/tf_static" else []
            connection = self._bag.add_connection(
                message.topic, message.message_type, typestore=STORE, offered_qos_profiles=latched
            )
            self._connections[message.topic] = connection
        self._bag.write(connection, message.received_ns, message.data)
        self.bytes += len(message.data)

    def close(self) -> Path:
        """Finish the bag, and rename it to what it will be called; returns its path."""
        self._bag.close()
        written = self._scratch / self.path.stem / self.path.name
        with written.open("rb") as file:
            os.fsync(file.fileno())
        written.replace(self.path)
        shutil.rmtree(self._scratch, ignore_errors=True)
        return self.path

    def abandon(self) -> None:
        """Give the bag up after an error: nothing of it stays on the disk."""
        with suppress(Exception):  # it is about to be removed; a full disk would be told a second time
            self._bag.close()
        shutil.rmtree(self._scratch, ignore_errors=True)


def keep_quota(folder: Path, quota_bytes: float) -> list[Path]:
    """Remove belie's oldest bags until the rest fits; returns what was removed.

    The newest stays, whatever its size: its own length is bounded by ``longest_s``.

    >>> with tempfile.TemporaryDirectory() as folder:
    ...     for k in range(3):
    ...         _ = (Path(folder) / f"{PREFIX}{k}.mcap").write_bytes(b"x" * 10)
    ...     [path.name for path in keep_quota(Path(folder), 20)]
    ['belie-evidence-0.mcap']
    """
    bags = sorted(folder.glob(f"{PREFIX}*.mcap"))  # their names begin with the time
    total = sum(bag.stat().st_size for bag in bags)
    removed = []
    for bag in bags[:-1]:
        if total <= quota_bytes:
            break
        total -= bag.stat().st_size
        bag.unlink()
        removed.append(bag)
    return removed


def clear_unfinished(folder: Path) -> None:
    """Remove what an earlier process left unfinished.

    >>> clear_unfinished(Path("no/such/folder"))
    """
    if folder.is_dir():
        for scratch in folder.glob(f".{PREFIX}*"):
            shutil.rmtree(scratch, ignore_errors=True)
