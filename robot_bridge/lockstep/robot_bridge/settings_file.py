"""The settings of `lockstep robot` in a TOML file. Flags and environment variables override it."""

from collections.abc import Iterable
from pathlib import Path

from lockstep.protocol.files.setting_names import not_a_setting
from lockstep.protocol.files.toml_file import TomlUnusable, read_toml
from lockstep.robot_bridge.errors import SettingsError

__all__ = ["read_settings_file"]

MAX_NUMBER = 2**53


def read_settings_file(path: Path, names: Iterable[str]) -> dict[str, str]:
    """Return the settings in `path` by name, each as the text that its environment variable would have.

    Args:
        path: the file
        names: the settings that it may have

    Raises:
        SettingsError: the file cannot be read, is not TOML, or has something that is no setting.
    """
    try:
        content, _ = read_toml(path)
    except TomlUnusable as error:
        raise SettingsError(str(error)) from error
    known = set(names)
    for name, value in content.items():
        if name not in known:
            raise SettingsError(f"{path}: {not_a_setting(name, known)}")
        if not isinstance(value, bool | int | float | str):
            raise SettingsError(f"{path}: {name} has to be a text, a number, true or false")
        if isinstance(value, int) and abs(value) > MAX_NUMBER:
            raise SettingsError(f"{path}: {name} is too large a number")
    return {name: str(value).lower() if isinstance(value, bool) else str(value) for name, value in content.items()}
