"""Makes the secrets that containers of one machine share: `python -m server.make_secrets FOLDER`.

A secret that is there already stays. The folder is mounted by nobody else, so its files may be read by every user:
each container runs as one of its own.
"""

import os
import secrets
import sys
from pathlib import Path

__all__ = ["NAMES", "main", "make_secrets"]

NAMES = ("link_secret", "turn_secret")
SECRET_BYTES = 32


def make_secrets(folder: Path) -> list[str]:
    """The names of those that were missing."""
    made = []
    for name in NAMES:
        try:
            file = os.open(folder / name, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o444)
        except FileExistsError:
            continue
        with open(file, "w") as stream:
            stream.write(secrets.token_urlsafe(SECRET_BYTES))
        made.append(name)
    return made


def main(arguments: list[str]) -> int:
    if len(arguments) != 1 or not Path(arguments[0]).is_dir():
        sys.stderr.write("usage: python -m server.make_secrets FOLDER\n")
        return 2
    make_secrets(Path(arguments[0]))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
