"""The shell around the commands: start-up, version, interruptions, faults of our own."""

import json
import subprocess
import sys

import pytest

from belie.cli.errors import exit_code_of

BELIE = [sys.executable, "-c", "from belie.cli.main import app; app()"]


def belie(*arguments):
    return subprocess.run(
        [*BELIE, *map(str, arguments)], capture_output=True, text=True, timeout=60, check=False
    )


def test_help_and_version_load_nothing_heavy():
    code = (
        "import sys\n"
        "from belie.cli.main import app\n"
        "try: app([sys.argv[1]])\n"
        "except SystemExit as end: assert end.code == 0\n"
        "loaded = {'numpy', 'cv2', 'numba', 'scipy', 'pydantic', 'matplotlib'} & set(sys.modules)\n"
        "assert not loaded, loaded\n"
    )
    for flag, expected in (("--help", "Exit codes: 0 no alert, 1 alert raised"), ("--version", "belie ")):
        done = subprocess.run([sys.executable, "-c", code, flag], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        assert expected in done.stdout


@pytest.mark.parametrize("command", ["info", "check", "attack", "config", "calibrate"])
def test_help_teaches_by_example(run, command):
    result = run(command, "--help")
    assert result.exit_code == 0
    assert f"belie {command} " in result.stdout.split("Examples:")[1]


def test_exit_codes_of_the_program_itself(attacked):
    assert belie("check", attacked).returncode == 1
    missing = belie("check", "none.mcap")
    assert (missing.returncode, missing.stdout) == (2, "")
    assert missing.stderr == "belie: error: none.mcap does not exist\n"


def test_unknown_commands_are_one_line():
    done = belie("chekc")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "check" in done.stderr


def test_without_a_command_the_help_is_shown():
    done = belie()
    assert done.returncode == 2
    assert "Commands:" in done.stderr.splitlines()


def test_a_reader_that_leaves_early_is_no_error(drive):
    with subprocess.Popen(
        [*BELIE, "check", str(drive), "--json", "-"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert json.loads(process.stdout.readline())["frame"] == 0
        process.stdout.close()
        errors = process.stderr.read()
        assert process.wait(60) == 141
    assert errors == ""


def test_ctrl_c_is_one_line(run, drive, monkeypatch):
    def interrupted(*_args, **_kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr("belie.recordings.open_recording", interrupted)
    done = run("check", drive)
    assert done.exit_code == 130
    assert done.stderr == "belie: interrupted\n"


def test_our_own_faults_are_one_line_with_a_way_to_see_more(capsys):
    with pytest.raises(KeyError) as fault:
        {}["missing"]
    assert exit_code_of(fault.value) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "a fault of belie itself: KeyError at test_errors.py" in said
    assert "BELIE_DEBUG=1" in said


def test_debug_shows_the_traceback(run, monkeypatch):
    monkeypatch.setenv("BELIE_DEBUG", "1")
    done = run("check", "none.mcap")
    assert "Traceback" in done.stderr
    assert done.exit_code == 2


def test_a_recording_is_never_written_over(run, drive):
    before = drive.stat().st_size
    for flag in ("--json", "--report"):
        done = run("check", drive, flag, drive)
        assert done.exit_code == 2
        assert "would overwrite the recording itself" in done.stderr
    assert drive.stat().st_size == before
