"""Scenarios: all that are shipped load, unknown keys are refused, and a copy can be edited."""

import pytest

from belie.simulation.scenario import Scenario, load_scenario, scenario_text, shipped_scenarios
from belie.types import ConfigError


@pytest.mark.parametrize("name", shipped_scenarios())
def test_every_shipped_scenario_loads_and_starts_with_a_comment(name):
    scenario = load_scenario(name)
    assert scenario.frame_count == round(scenario.duration_s * scenario.frame_rate_hz)
    assert scenario_text(name).startswith("# ")
    positions = [scenario.sensors.gnss.rate_hz > 0, scenario.sensors.localisation.rate_hz > 0]
    assert sum(positions) == 1, "belie check takes one position stream"


def test_a_copy_can_be_edited(tmp_path):
    copy = tmp_path / "mine.toml"
    copy.write_text(scenario_text("corridor") + "\n[sensors.imu]\nrate_hz = 100\n")
    scenario = load_scenario(copy, seed=9, weather=None)
    assert (scenario.scene, scenario.seed, scenario.sensors.imu.rate_hz) == ("corridor", 9, 100.0)
    assert scenario.sensors.imu.gyro_bias_deg_s == 0.33


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("scen = 'street'", "scen: no such setting"),
        ("[sensors.imu]\nrate = 1", r"sensors\.imu\.rate: no such setting"),
        ("weather = 'hail'", "weather: Input should be 'sunny'"),
        ("scene = ", "is no TOML"),
        ("[sensors.gnss.arrival]\ndelay_ms=2\njitter_ms=3", "jitter_ms must be less than delay_ms"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(tmp_path, text, said):
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=said) as caught:
        load_scenario(path)
    assert "\n" not in str(caught.value)


def test_distortion_can_be_switched_on():
    assert Scenario().camera_model().model == "pinhole"
    assert Scenario(distortion=True).camera_model().is_distorted
