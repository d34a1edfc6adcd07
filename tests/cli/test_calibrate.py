"""``belie calibrate``: settings from honest drives, and the refusal of others."""

from belie.detector import Config, load_config
from belie.evaluation.calibrate import Calibration


def test_an_honest_drive_gives_settings_that_say_what_stands_behind_them(run, drive, tmp_path):
    output = tmp_path / "belie.toml"
    result = run("calibrate", drive, "-o", output)
    assert result.exit_code == 0, result.output
    written = output.read_text(encoding="utf-8")
    assert "# Calibrated on 9 s of driving: 6 s taught, 3 s proved." in written
    assert "Asked for: at most one false alarm per 10 h" in result.stdout
    assert (
        "Measured: no alert in 9 s; alone it proves at best one false alarm per 3 s (95 %)" in result.stdout
    )
    calibrated = load_config(output)
    noise = f"{calibrated.odometry.translation_noise:g} (before: {Config().odometry.translation_noise:g})"
    assert f"Set: odometry.translation_noise = {noise}: " in result.stdout
    assert calibrated.odometry.translation_noise != Config().odometry.translation_noise
    assert run("check", drive, "--config", output).exit_code == 0
    assert run("calibrate", drive, "-o", output).exit_code == 2


def test_an_attacked_drive_is_refused(run, attacked, tmp_path):
    result = run("calibrate", attacked, "-o", tmp_path / "belie.toml")
    assert result.exit_code == 2
    assert "looks attacked: odometry_spoofing on /odom at 6." in result.stderr
    assert result.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_stricter_rate_that_was_set_is_not_told_as_the_rate_that_was_asked_for():
    stricter = Config(sequential=Config().sequential.model_copy(update={"false_alarms_per_hour": 1e-4}))
    notes = {"sequential.false_alarms_per_hour": "calibrated: imu /imu needs it"}
    found = Calibration(
        config=stricter, start=Config(), notes=notes, learnt_s=400.0, held_out_s=200.0, largest_ratio={}
    )
    assert "Asked for: at most one false alarm per 10 h" in "\n".join(found.words())
    (told,) = found.set_words()
    assert told == "Set: sequential.false_alarms_per_hour = 0.0001 (before: 0.1): imu /imu needs it"


def test_a_file_of_detections_is_about_one_recording(run, drive, tmp_path):
    boxes, none = tmp_path / "boxes.csv", tmp_path / "none.csv"
    boxes.write_text("frame,label,left,top,right,bottom\n0,car,10,10,60,60\n89,,,,,\n")
    none.write_text("frame,label,left,top,right,bottom\n0,,,,,\n89,,,,,\n")
    result = run("calibrate", drive, drive, "--detections", boxes, "-o", tmp_path / "belie.toml")
    assert result.exit_code == 2
    assert "give --detections once for each SOURCE" in result.stderr
    assert result.stderr.count("\n") == 1
    files = ["--detections", boxes, "--detections", none]
    result = run("calibrate", drive, drive, *files, "-o", tmp_path / "belie.toml")
    assert result.exit_code == 0, result.output
    assert "/detections: its misses and misnamings were not learned" in result.stdout


def test_a_detector_that_teaches_nothing_is_told(run, drive, tmp_path):
    boxes = tmp_path / "boxes.csv"
    boxes.write_text("frame,label,left,top,right,bottom\n80,car,10,10,60,60\n81,,,,,\n")  # in the last third
    result = run("calibrate", drive, "--detections", boxes, "-o", tmp_path / "belie.toml")
    assert result.exit_code == 0, result.output
    assert "/detections: its misses and misnamings were not learned: 0 messages" in result.stdout
    assert "/detections" not in run("calibrate", drive, "-o", tmp_path / "none.toml").stdout
