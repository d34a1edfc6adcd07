"""README's Python examples run as they stand, and what it promises by line 25 is there."""

import doctest
import importlib.util
import itertools
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def corridor():
    spec = importlib.util.spec_from_file_location("corridor", ROOT / "examples" / "corridor.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_python_examples(corridor, tmp_path, monkeypatch):
    from belie.recordings import write_mcap

    write_mcap(
        tmp_path / "drive.mcap", itertools.islice(corridor.steps(), 32), cameras={"/camera/image": corridor.CAMERA},
        body_axes="flu", image_encoding="jpeg",
    )  # fmt: skip
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "README.md").read_text()
    test = doctest.DocTestParser().get_doctest(text, {}, "README", "README.md", 0)
    assert len(test.examples) >= 6
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    runner.run(test)
    assert runner.failures == 0


def test_both_commands_stand_by_line_25():
    head = "\n".join((ROOT / "README.md").read_text().splitlines()[:25])
    assert "belie demo" in head
    assert "make check" in head
