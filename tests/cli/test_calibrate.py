"""``belie calibrate``: settings from honest drives, and the refusal of others."""

from belie.detector import Config, load_config


def test_an_honest_drive_gives_settings_that_say_what_stands_behind_them(run, drive, tmp_path):
    output = tmp_path / "belie.toml"
    result = run("calibrate", drive, "-o", output)
    assert result.exit_code == 0, result.output
    written = output.read_text(encoding="utf-8")
    assert "# Calibrated on 9 s of driving: 6 s taught, 3 s proved." in written
    assert "proves at best one false alarm per 3 s (95 %); wanted is one per 10 h" in result.stdout
    calibrated = load_config(output)
    assert calibrated.odometry.translation_noise != Config().odometry.translation_noise
    assert run("check", drive, "--config", output).exit_code == 0
    assert run("calibrate", drive, "-o", output).exit_code == 2


def test_an_attacked_drive_is_refused(run, attacked, tmp_path):
    result = run("calibrate", attacked, "-o", tmp_path / "belie.toml")
    assert result.exit_code == 2
    assert "looks attacked: odometry_spoofing on /odom at 6." in result.stderr
    assert result.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_detector_that_teaches_nothing_is_told(run, drive, tmp_path):
    boxes = tmp_path / "boxes.csv"
    boxes.write_text("frame,label,left,top,right,bottom\n80,car,10,10,60,60\n81,,,,,\n")  # in the last third
    result = run("calibrate", drive, "--detections", boxes, "-o", tmp_path / "belie.toml")
    assert result.exit_code == 0, result.output
    assert "/detections: its misses and misnamings were not learned: 0 messages" in result.stdout
    assert "/detections" not in run("calibrate", drive, "-o", tmp_path / "none.toml").stdout
