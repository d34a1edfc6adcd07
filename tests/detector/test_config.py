import pytest

from belie.detector import Config, load_config, parse_config
from belie.types import ConfigError


def test_file_overrides_some_and_keeps_the_rest(tmp_path):
    path = tmp_path / "belie.toml"
    path.write_text("[sequential]\nfalse_alarms_per_hour = 2.0\n")
    config = load_config(path)
    assert config.sequential.false_alarms_per_hour == 2.0
    assert config.odometry == Config().odometry


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("[sequential]\nfalse_alarm_per_hour = 1\n", "sequential.false_alarm_per_hour"),
        ("[odometry]\ntranslation_noise = -1\n", "odometry.translation_noise"),
        ("profile = 'best'\n", "profile"),
        ("[odometry\n", "TOML"),
    ],
)
def test_mistakes_are_named_in_one_line(tmp_path, text, named):
    path = tmp_path / "belie.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=named) as caught:
        load_config(path)
    assert "\n" not in str(caught.value)


def test_missing_file_is_named(tmp_path):
    with pytest.raises(ConfigError, match=r"nothing\.toml"):
        load_config(tmp_path / "nothing.toml")


def test_unknown_value_types_are_refused():
    with pytest.raises(ConfigError, match="visual_odometry"):
        parse_config({"visual_odometry": 3})
