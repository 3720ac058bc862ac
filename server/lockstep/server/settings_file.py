"""Reads settings from a TOML file. Flags and environment variables override it."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, SecretStr
from pydantic.fields import FieldInfo
from pydantic_settings import BaseSettings, PydanticBaseSettingsSource

from lockstep.protocol.files.setting_names import not_a_setting
from lockstep.protocol.files.toml_file import TomlUnusable, read_toml

__all__ = ["SettingsFileSource", "SettingsFileUnusable", "exposed_secrets", "read_settings_file"]

ELSEWHERE = frozenset({"config"})  # a file that names another would need an order between them


class SettingsFileUnusable(Exception):
    """The file cannot be read, is not TOML, or names a setting that does not exist. The text says where."""


class SettingsFileSource(PydanticBaseSettingsSource):
    """The settings in the file that the flag or variable `config` names; no settings without `config`."""

    def __init__(self, settings: type[BaseSettings], *sources: PydanticBaseSettingsSource) -> None:
        """`sources`: where `config` may be set, in the order in which they are asked."""
        super().__init__(settings)
        self._sources = sources

    def get_field_value(self, field: FieldInfo, field_name: str) -> tuple[Any, str, bool]:
        """Return nothing: a call of this source returns all fields at once."""
        return None, field_name, False

    def __call__(self) -> dict[str, Any]:
        """Return the settings by name.

        Raises:
            SettingsFileUnusable: the file cannot be read, is not TOML, or names a setting that does not exist.
        """
        for source in self._sources:
            path = source().get("config")
            if path:
                return read_settings_file(Path(path), self.settings_cls)
        return {}


def read_settings_file(path: Path, settings: type[BaseModel]) -> dict[str, Any]:
    """Return the settings in `path` by name. With tables `[robots.NAME]` the file is the fleet's file as well.

    Raises:
        SettingsFileUnusable: the file cannot be read, is not TOML, or names a setting that does not exist.
    """
    try:
        content, _ = read_toml(path)
    except TomlUnusable as error:
        raise SettingsFileUnusable(str(error)) from error
    if isinstance(content.get("robots"), dict):
        del content["robots"]
        wrong = next((name for name in ("robot", "fleet_file") if name in content), None)
        if wrong is not None:
            raise SettingsFileUnusable(f"{path}: {wrong} cannot stand beside tables [robots.NAME]")
        content["fleet_file"] = str(path)
    unknown = next(_unknown(content, settings, ""), None)
    if unknown is not None:
        raise SettingsFileUnusable(f"{path}: {unknown}")
    return content


def exposed_secrets(path: Path, settings: type[BaseModel]) -> list[str]:
    """Return the names of the secrets in `path`, if everybody on this machine may read it.

    Raises:
        SettingsFileUnusable: the file cannot be read, or is not TOML.
    """
    try:
        content, for_all = read_toml(path)
    except TomlUnusable as error:
        raise SettingsFileUnusable(str(error)) from error
    return sorted(set(_found(content, set(_secrets(settings))))) if for_all else []


def _secrets(settings: type[BaseModel]) -> Iterator[str]:
    """Yield the names of the settings that are secret."""
    for name, field in settings.model_fields.items():
        inner = _nested(field)
        if SecretStr in (field.annotation, *get_args(field.annotation)):
            yield name
        elif inner is not None:
            yield from _secrets(inner)


def _found(content: Mapping[str, Any], names: set[str]) -> Iterator[str]:
    """Yield those names that have a value, in whichever table."""
    for name, value in content.items():
        if isinstance(value, dict):
            yield from _found(value, names)
        elif name in names and value:
            yield name


def _unknown(content: Mapping[str, Any], settings: type[BaseModel], within: str) -> Iterator[str]:
    """Yield a sentence for each name in the file that is not a setting."""
    names = settings.model_fields.keys() - ELSEWHERE
    for name, value in content.items():
        if name not in names:
            yield not_a_setting(name, names, within=within)
        elif isinstance(value, dict):
            inner = _nested(settings.model_fields[name])
            if inner is not None:
                yield from _unknown(value, inner, f"{within}{name}.")


def _nested(field: FieldInfo) -> type[BaseModel] | None:
    """Return the class of a setting that is a table."""
    kinds = (field.annotation, *get_args(field.annotation))
    return next((kind for kind in kinds if isinstance(kind, type) and issubclass(kind, BaseModel)), None)
