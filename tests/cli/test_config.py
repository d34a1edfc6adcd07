"""``belie config``: the printed settings are a settings file."""

import tomllib

import pytest

from belie.detector import Config, load_config
from belie.types import Settings


@pytest.mark.parametrize("flags", [[], ["--profile", "paper"], ["--false-alarms-per-hour", "2.5"]])
def test_round_trip(run, tmp_path, flags):
    result = run("config", *flags)
    assert result.exit_code == 0, result.output
    path = tmp_path / "belie.toml"
    path.write_text(result.stdout, encoding="utf-8")
    values = tomllib.loads(result.stdout)
    loaded = load_config(path)
    assert values["profile"] == loaded.profile == ("paper" if "paper" in flags else "default")
    changes = {} if not flags or "paper" in flags else {"sequential": {"false_alarms_per_hour": 2.5}}
    assert loaded == Config.model_validate({"profile": loaded.profile, **changes})


def leaves(settings, path=()):
    """Every setting that is no group: dotted path, and its description."""
    for name, field in type(settings).model_fields.items():
        value = getattr(settings, name)
        if isinstance(value, Settings):
            yield from leaves(value, (*path, name))
        else:
            yield (*path, name), field.description


def test_every_setting_is_there_with_its_meaning(run):
    printed = run("config").stdout
    values = tomllib.loads(printed)
    words = " ".join(printed.replace("#", " ").split())
    for path, description in leaves(Config()):
        group = values
        for name in path:
            assert name in group, path
            group = group[name]
        assert description, f"{path} has no description"
        assert " ".join(description.split()) in words


def test_own_settings_are_completed_and_their_defaults_told(run, tmp_path):
    path = tmp_path / "belie.toml"
    path.write_text("[sequential]\nrelease_s = 2.5\n")
    lines = run("config", "--config", path).stdout.splitlines()
    at = lines.index("release_s = 2.5")
    assert lines[at - 1] == f"# default: {Config().sequential.release_s}"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            "[sequential]\nrelese_s = 2.5\n",
            "sequential.relese_s: no such setting; did you mean sequential.release_s?",
        ),
        (
            "release_s = 2.5\n",
            "release_s: no such setting; did you mean sequential.release_s or camera.release_s?",
        ),
        ("[sequentiel]\n", "sequentiel: no such setting; did you mean sequential?"),
        ("[objects.classes]\ngruops = 1\n", "did you mean objects.classes.groups?"),
        (
            "[sequential]\nxyz = 2.5\n",
            "sequential.xyz: no such setting; known here are false_alarms_per_hour,",
        ),
    ],
)
def test_a_misspelt_key_is_one_line(run, tmp_path, text, says):
    path = tmp_path / "belie.toml"
    path.write_text(text)
    result = run("config", "--config", path)
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1
    assert says in result.stderr
