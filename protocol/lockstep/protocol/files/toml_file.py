"""Reads a TOML file of a bounded size, and never waits for one that is not a file."""

import os
import stat
import tomllib
from pathlib import Path
from typing import Any

from lockstep.protocol.files.regular_file import open_regular

__all__ = ["MAX_TOML", "TomlUnusable", "read_toml"]

MAX_TOML = 1 << 20  # bytes


class TomlUnusable(Exception):
    """The file cannot be read, or is not TOML. The text says where."""


def read_toml(path: Path) -> tuple[dict[str, Any], bool]:
    """Return the content, and whether everybody on this machine may read the file.

    Raises:
        TomlUnusable: it cannot be read, is no regular file, is too long, or is not TOML.
    """
    try:
        with open_regular(path) as file:
            data = file.read(MAX_TOML + 1)
            for_all = bool(os.fstat(file.fileno()).st_mode & stat.S_IROTH)
        if len(data) > MAX_TOML:
            raise TomlUnusable(f"{path}: longer than {MAX_TOML} bytes")
        return tomllib.loads(data.decode()), for_all
    except RecursionError as error:
        raise TomlUnusable(f"{path}: nested too deeply") from error
    except (OSError, ValueError) as error:  # ValueError: not UTF-8, not TOML, or a number with too many digits
        raise TomlUnusable(f"{path}: {error}") from error
