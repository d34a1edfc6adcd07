"""``belie config``: every setting, explained."""

from __future__ import annotations

from belie.cli.options import ConfigFile, FalseAlarms, Profile


def config(
    profile: Profile = None,
    config: ConfigFile = None,
    false_alarms_per_hour: FalseAlarms = None,
) -> None:
    """Print every setting with its unit, default and meaning, as TOML.

    The output is a complete settings file: keep the lines that you change, and leave out the rest.

    \b
    Examples:
      belie config > belie.toml
      belie config --profile paper
      belie config --config belie.toml            your settings, completed and explained
      belie check drive.mcap --config belie.toml
    """  # noqa: D301 (\b keeps the lines of the examples)
    from belie.cli.settings import config_from_flags
    from belie.evaluation.config_toml import to_toml

    settings = config_from_flags(config, profile, false_alarms_per_hour)
    header = "Settings of belie. Use: belie check SOURCE --config belie.toml"
    print(to_toml(settings, header=header), end="")
