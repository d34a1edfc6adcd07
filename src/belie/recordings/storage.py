"""Bags on disk: opened, listed and read through ``rosbags``, whose errors become one clear line."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np
import numpy.typing as npt
from rosbags import rosbag1, rosbag2
from rosbags.interfaces import Connection, MessageDefinitionFormat
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from belie.recordings.vision_messages import VISION_TYPES
from belie.types import BelieError, RecordingError

BagFormat = Literal["ros2-mcap", "ros2-sqlite3", "ros1"]

_LONGEST = 160
_MENDING: dict[str, str] = {
    "ros2-mcap": "if it was cut short or damaged, mend it with `mcap recover {name} -o mended.mcap`",
    "ros2-sqlite3": "if it was cut short or damaged, mend it with `sqlite3 {name} .recover | sqlite3 mended.db3`",
    "ros1": "if it was cut short, mend it with `rosbag reindex {name}`",
}
# What each format needs for its first header and its end, before there is a message [bytes].
_SMALLEST: dict[str, int] = {"ros2-mcap": 62, "ros2-sqlite3": 512, "ros1": 64}
# Raised by parsers that run into the end of the file, or into bytes that are no record; their words help nobody.
_CODE_ERRORS = (struct.error, TypeError, AssertionError, IndexError, KeyError)


@contextmanager
def _clear_errors(path: Path, format: str) -> Iterator[None]:
    """Whatever rosbags raises on a damaged file (assertions, struct errors …) as one line."""
    try:
        yield
    except (BelieError, GeneratorExit):
        raise
    except MemoryError as error:
        raise RecordingError(f"{path} is damaged: a record claims more bytes than there is memory") from error
    except Exception as error:  # the list of what parsers raise on damaged bytes is open-ended
        said = " ".join(str(error).split()) or type(error).__name__
        if "end magic" in said:
            said = "it has no end mark, so the recording was cut short"
        elif isinstance(error, _CODE_ERRORS):
            said = "a record in it is damaged or cut short"
        raise RecordingError(
            f"{path} cannot be read as {format}: {said[:_LONGEST].rstrip('.')}; "
            + _MENDING[format].format(name=path.name)
        ) from error


class OpenBag:
    """A bag that is open for reading. Made by `opened`.

    Attributes
    ----------
    path : Path
        The bag.
    connections : sequence of Connection
        One for each topic and type (ROS 1: and each publisher).
    lost : Counter
        Messages by topic that the index counts, and that the last pass of `messages` to the end did not find.
    """

    def __init__(self, path: Path, format: BagFormat, reader: Any) -> None:
        self.path = path
        self.format = format
        self._reader = reader
        self.connections: Sequence[Connection] = list(reader.connections)
        self.lost: Counter[str] = Counter()
        self._store: Typestore | None = None
        self._known: set[str] = set()

    def of_topics(self, topics: Sequence[str]) -> list[Connection]:
        """The connections of some topics."""
        return [connection for connection in self.connections if connection.topic in topics]

    def messages(self, topics: Sequence[str]) -> Generator[tuple[Connection, int, bytes], None, None]:
        """(connection, receive time in ns, bytes) of some topics in order of receive time."""
        connections = self.of_topics(topics)
        if not connections:
            return
        with _clear_errors(self.path, self.format):
            messages = self._reader.messages(connections)
        found: Counter[str] = Counter()
        while True:
            with _clear_errors(self.path, self.format):
                entry = next(messages, None)
            if entry is None:
                break
            found[entry[0].topic] += 1
            yield entry
        counted: Counter[str] = Counter()
        for connection in connections:
            counted[connection.topic] += connection.msgcount
        self.lost = counted - found

    def deserialize(self, connection: Connection, data: bytes) -> Any:
        """A message's fields, by the definition that the bag embeds, else the newest ROS release's."""
        with _clear_errors(self.path, self.format):
            store = self._types(connection)
            if self.format == "ros1":
                return store.deserialize_ros1(data, connection.msgtype)
            return store.deserialize_cdr(data, connection.msgtype)

    def header_stamp_ns(self, data: bytes) -> int:
        """Header stamp of a stamped message, read from its first bytes alone."""
        with _clear_errors(self.path, self.format):
            if self.format == "ros1":  # seq, then seconds and nanoseconds
                seconds, nanoseconds = struct.unpack_from("<II", data, 4)
            else:  # the CDR header's second byte tells the byte order
                seconds, nanoseconds = struct.unpack_from("<iI" if data[1] & 1 else ">iI", data, 4)
        return int(seconds) * 1_000_000_000 + int(nanoseconds)

    def receive_times_ns(self, topic: str) -> npt.NDArray[np.int64]:
        """Receive times of a topic's messages, shape (N,), from the bag's index where it has one."""
        connections = self.of_topics([topic])
        with _clear_errors(self.path, self.format):
            times = [_indexed_times(storage, connections) for storage in _storages(self._reader)]
        if any(part is None for part in times):
            return np.array([received_ns for _, received_ns, _ in self.messages([topic])], dtype=np.int64)
        return np.concatenate([cast("npt.NDArray[np.int64]", part) for part in times])

    def _types(self, connection: Connection) -> Typestore:
        # Only the types that are read are registered: another topic's faulty definition does no harm.
        if self._store is None:
            self._store = get_typestore(Stores.EMPTY)
        if connection.msgtype not in self._known:
            self._known.add(connection.msgtype)
            types = self._definitions(connection)
            self._require_fields(types)
            self._store.register(types)
        return self._store

    def _require_fields(self, types: Any) -> None:
        """Refuse definitions of common messages that lack a field: they are damaged, or of another kind."""
        usual = self._usual_types()
        for name in types.keys() & usual.keys():
            fields = {field.lower() for field, _ in types[name][1]}
            lacking = [field for field, _ in usual[name][1] if field.lower() not in fields]
            if lacking:
                raise RecordingError(
                    f"{self.path}: its definition of {name} lacks {', '.join(lacking)}; the file is damaged"
                )

    def _usual_types(self) -> Any:
        return get_typestore(Stores.ROS1_NOETIC if self.format == "ros1" else Stores.LATEST).fielddefs

    def _definitions(self, connection: Connection) -> Any:
        definition = connection.msgdef
        if definition.format == MessageDefinitionFormat.MSG:
            return get_types_from_msg(definition.data, connection.msgtype)
        if definition.format == MessageDefinitionFormat.IDL:
            types: dict[Any, Any] = {}
            separator = "=" * 80 + "\n"
            for part in definition.data.split(separator):
                if part.strip():
                    types.update(
                        get_types_from_idl(part.split("\n", 1)[1] if part.startswith("IDL: ") else part)
                    )
            return types
        return {**self._usual_types(), **VISION_TYPES}


def _storages(reader: Any) -> list[Any]:
    """The files behind a reader: a ROS 2 folder may be split over several."""
    storage = getattr(reader, "storage", reader)
    return list(getattr(storage, "storages", [storage]))


def _indexed_times(storage: Any, connections: Sequence[Connection]) -> npt.NDArray[np.int64] | None:
    """Receive times from a file's index; None if it has none."""
    topics = {connection.topic for connection in connections}
    ids = [connection.id for connection in storage.connections if connection.topic in topics]
    if isinstance(storage, rosbag1.Reader):
        times = [entry.time for key in ids for entry in storage.indexes.get(key, ())]
    elif isinstance(storage, Sqlite3Reader):
        marks = ",".join("?" * len(ids))
        database: Any = storage.dbconn
        rows = database.execute(f"SELECT timestamp FROM messages WHERE topic_id IN ({marks})", ids)
        times = [row[0] for row in rows]
    elif isinstance(storage, McapReader) and storage.chunks:
        return _mcap_index_times(storage, set(ids))
    else:
        return None
    return np.array(times, dtype=np.int64)


def _mcap_index_times(storage: McapReader, ids: set[int]) -> npt.NDArray[np.int64] | None:
    """Log times from MCAP's MessageIndex records (opcode 7), which follow each chunk."""
    file: Any = storage.bio
    entry = np.dtype([("time", "<u8"), ("offset", "<u8")])
    found = [np.empty(0, np.int64)]
    for chunk in storage.chunks:
        if not chunk.message_index_offsets:
            return None
        for key in ids & chunk.message_index_offsets.keys():
            file.seek(chunk.message_index_offsets[key])
            opcode, _, channel, size = struct.unpack("<BQHI", file.read(15))
            if opcode != 7 or channel != key or size % entry.itemsize:
                return None
            found.append(np.frombuffer(file.read(size), entry)["time"].astype(np.int64))
    return np.concatenate(found)


_READERS: dict[str, Callable[[Path], Any]] = {
    "ros1": rosbag1.Reader,
    "ros2-mcap": McapReader,
    "ros2-sqlite3": Sqlite3Reader,
}


@contextmanager
def opened(path: Path, format: BagFormat) -> Iterator[OpenBag]:
    """Open a bag: a file of `format`, whatever its name, or a ROS 2 bag folder with ``metadata.yaml``.

    Raises
    ------
    RecordingError
        If it is damaged, cut short or empty.
    """
    if path.is_file() and (size := path.stat().st_size) < _SMALLEST[format]:
        raise RecordingError(
            f"{path} cannot be read as {format}: it was cut short, its {size} bytes hold no message; copy it again, "
            "or record again"
        )
    with _clear_errors(path, format):
        reader = rosbag2.Reader(path) if path.is_dir() else _READERS[format](path)
        reader.open()
    try:
        yield OpenBag(path, format, reader)
    finally:
        reader.close()
