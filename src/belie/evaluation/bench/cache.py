"""Where rendered pictures and trained models are kept between runs, and how much of the disk they may take."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable
from contextlib import suppress
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from pydantic import Field

from belie.types import Settings

_GB = 1e9


class CacheSettings(Settings):
    """The picture cache of the benchmark.

    >>> CacheSettings(folder="/tmp/pictures").path().as_posix()
    '/tmp/pictures'
    """

    folder: str = Field(
        "", description="where; `belie/bench` in the user's cache folder (XDG_CACHE_HOME) if empty"
    )
    limit_gb: float = Field(
        20.0,
        gt=0.0,
        description="size above which the pictures longest unused are deleted [GB]; "
        "an hour of 640x480 at 10 Hz takes 5",
    )

    def path(self) -> Path:
        """The folder."""
        if self.folder:
            return Path(self.folder).expanduser()
        base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        return Path(base) / "belie" / "bench"


def content_key(value: Any) -> str:
    """A short name that equal values share: of plain values, whatever their order in mappings.

    >>> content_key({"a": 1, "b": 2}) == content_key({"b": 2, "a": 1})
    True
    """
    text = json.dumps(value, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:20]


@cache
def code_key(parts: tuple[str, ...], leave_out: tuple[str, ...] = ()) -> str:
    """Names the source code of some of belie's packages: another code, another key.

    >>> code_key(("geometry",)) != code_key(("types",))
    True
    """
    digest = hashlib.sha256()
    root = Path(str(files("belie")))
    for part in parts:
        found = [root / part] if (root / part).is_file() else sorted((root / part).rglob("*"))
        for file in found:
            name = file.relative_to(root).as_posix()
            if file.suffix in (".py", ".toml", ".json") and not name.startswith(leave_out or ("//",)):
                digest.update(name.encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()[:20]


def make_room(folder: Path, limit_gb: float, keep: Iterable[Path] = ()) -> list[Path]:
    """Delete the files longest unused until the folder is within its limit; gives what was deleted.

    Parameters
    ----------
    folder : Path
        Of the cache; files in it are judged by the time of their last use (modification; see `touch`).
    limit_gb : float
        GB.
    keep : iterable of Path
        Not to be deleted, nor what lies beside them under their name.
    """
    kept = tuple(path.name for path in keep)
    sizes = {file: file.stat() for file in folder.glob("*.mcap*") if file.is_file()}
    total, deleted = float(sum(stat.st_size for stat in sizes.values())), list[Path]()
    for file, stat in sorted(sizes.items(), key=lambda item: item[1].st_mtime):
        if total <= limit_gb * _GB:
            break
        if not (kept and file.name.startswith(kept)):
            file.unlink(missing_ok=True)
            total -= stat.st_size
            deleted.append(file)
    return deleted


def touch(*paths: Path) -> None:
    """Note that files were used now."""
    for path in paths:
        with suppress(OSError):
            os.utime(path)
