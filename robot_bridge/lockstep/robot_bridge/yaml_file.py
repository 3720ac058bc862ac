"""Reads a YAML file into typed settings, with errors that name the file, the line and the key."""

import re
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from lockstep.protocol.files.regular_file import open_regular
from lockstep.robot_bridge.errors import RobotUnavailable, SettingsError

__all__ = ["SettingsPlace", "YamlFile"]

Settings = TypeVar("Settings")
Key = str | int
MAX_BYTES = 1 << 20
MAX_DEPTH = 32
MAX_VALUES = 100_000  # with those that an alias repeats

_PATH = re.compile(r" - at `\$(.*)`$", re.DOTALL)
_STEP = re.compile(r"\.([A-Za-z0-9_]+)|\[(\d+)\]")
_UNKNOWN = re.compile(r"^Object contains unknown field `(.*)`$", re.DOTALL)


class SettingsPlace(ValueError):
    """A value that contradicts others: raised by the code that knows its meaning, and located by `YamlFile.error`."""

    def __init__(self, keys: tuple[Key, ...], detail: str) -> None:
        super().__init__(keys, detail)
        self.keys = keys
        self.detail = detail


class YamlFile:
    """One document of plain maps, lists and scalars, and the line of each of its keys."""

    def __init__(self, path: Path) -> None:
        """Read the file.

        Raises:
            SettingsError: the file cannot be read, is no regular file, is too long, is not YAML, or is not one map.
            RobotUnavailable: PyYAML is missing.
        """
        self._path = path
        self._lines: dict[tuple[Key, ...], int] = {}
        try:
            with open_regular(path) as file:
                text = file.read(MAX_BYTES + 1)
        except OSError as error:
            raise SettingsError(f"{path}: {error.strerror}") from error
        if len(text) > MAX_BYTES:
            raise SettingsError(f"{path}: longer than {MAX_BYTES} bytes")
        self._data = self._load(text)

    def convert(self, kind: type[Settings]) -> Settings:
        """Return the whole document as `kind`.

        Raises:
            SettingsError: something is missing, unknown or of the wrong type or range.
        """
        try:
            return msgspec.convert(self._data, kind)
        except msgspec.ValidationError as error:
            detail = str(error)
            keys: tuple[Key, ...] = ()
            if (found := _PATH.search(detail)) is not None:
                detail = detail[: found.start()]
                keys = tuple(name or int(index) for name, index in _STEP.findall(found[1]))
            if (unknown := _UNKNOWN.match(detail)) is not None:
                detail, keys = "there is no such setting", (*keys, unknown[1])
            raise self.error(SettingsPlace(keys, detail.removeprefix("Object "))) from error

    def error(self, place: SettingsPlace) -> SettingsError:
        """Return the error with file, line and key."""
        keys = place.keys
        while keys and keys not in self._lines:  # a default has no line: its map's is the nearest
            keys = keys[:-1]
        line = self._lines.get(keys, 1)
        name = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in place.keys).lstrip(".")
        return SettingsError(f"{self._path}, line {line}: {name + ': ' if name else ''}{place.detail}")

    def _load(self, text: bytes) -> dict[str, Any]:
        try:
            import yaml
        except ImportError as error:
            raise RobotUnavailable("PyYAML is missing; every ROS installation has it: pip install pyyaml") from error
        try:
            loader = yaml.SafeLoader(text)
            try:
                data = _Reader(loader, self._lines).plain(loader.get_single_node(), (), 0)
            finally:
                loader.dispose()
        except SettingsPlace as place:
            raise self.error(place) from place
        except (yaml.YAMLError, ValueError, RecursionError) as error:
            raise SettingsError(f"{self._path}: {' '.join(str(error).split())}") from error
        if not isinstance(data, dict):
            raise SettingsError(f"{self._path}: must hold one map of settings")
        return data


class _Reader:
    """Turns nodes into plain data and notes their lines."""

    def __init__(self, loader: Any, lines: dict[tuple[Key, ...], int]) -> None:
        self._loader = loader
        self._lines = lines
        self._values = 0

    def plain(self, node: Any, keys: tuple[Key, ...], depth: int) -> Any:
        if node is None:
            return None
        self._lines.setdefault(keys, node.start_mark.line + 1)
        self._values += 1
        if self._values > MAX_VALUES:
            raise SettingsPlace(keys, f"more than {MAX_VALUES} values")
        if depth > MAX_DEPTH:
            raise SettingsPlace(keys, "nested too deeply")
        if node.id == "mapping":
            return self._map(node, keys, depth)
        if node.id == "sequence":
            return [self.plain(item, (*keys, index), depth + 1) for index, item in enumerate(node.value)]
        value = self._loader.construct_object(node)
        # YAML 1.1 takes 1e-3 for text because it has no dot; the author of a file never means text.
        return float(value) if isinstance(value, str) and node.style is None and _is_number(value) else value

    def _map(self, node: Any, keys: tuple[Key, ...], depth: int) -> dict[str, Any]:
        self._loader.flatten_mapping(node)
        data: dict[str, Any] = {}
        for key_node, value_node in node.value:
            key = self._loader.construct_object(key_node) if key_node.id == "scalar" else None
            line = key_node.start_mark.line + 1
            self._lines.setdefault((*keys, str(key)), line)
            if not isinstance(key, str):
                raise SettingsPlace((*keys, str(key)), "a key must be text")
            if key in data:
                self._lines[(*keys, key)] = line
                raise SettingsPlace((*keys, key), "given twice")
            data[key] = self.plain(value_node, (*keys, key), depth + 1)
        return data


def _is_number(text: str) -> bool:
    return re.fullmatch(r"[-+]?\d+(\.\d*)?[eE][-+]?\d+", text) is not None
