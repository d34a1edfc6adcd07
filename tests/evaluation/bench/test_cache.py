"""The picture cache stays within its limit, and drops what is longest unused."""

import os

from belie.evaluation.bench.cache import CacheSettings, make_room


def test_the_longest_unused_go_first_and_what_is_wanted_stays(tmp_path):
    for age, name in enumerate(["new", "middle", "old", "wanted"]):
        for suffix in (".mcap", ".mcap.objects.jsonl"):
            file = tmp_path / f"{name}{suffix}"
            file.write_bytes(bytes(1000))
            os.utime(file, (1e9 - age, 1e9 - age))
    gone = make_room(tmp_path, limit_gb=5e-6, keep=[tmp_path / "wanted.mcap"])
    left = {path.name.split(".")[0] for path in tmp_path.iterdir()}
    assert {path.name.split(".")[0] for path in gone} == {"old", "middle"}
    assert left >= {"new", "wanted"}
    assert sum(path.stat().st_size for path in tmp_path.iterdir()) <= 5000


def test_the_folder_follows_xdg(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert CacheSettings().path() == tmp_path / "belie" / "bench"
