"""Makes the secrets that containers of one machine share: `python -m lockstep.server.cli.make_secrets FOLDER`.

Each secret has its own folder in FOLDER, `link/link_secret` and `turn/turn_secret`, so that a container can be given
one and not see the other: the relay, which faces the Internet, does not need the robot's. Existing secrets stay.
Nobody else mounts the folders, so every user may read the files: each container runs as a different user.
"""

import os
import secrets
import sys
from pathlib import Path

__all__ = ["NAMES", "main", "make_secrets"]

NAMES = ("link/link_secret", "turn/turn_secret")
SECRET_BYTES = 32


def make_secrets(folder: Path) -> list[str]:
    """Make the missing secrets, and return their names."""
    made = []
    for name in NAMES:
        place = folder / name
        place.parent.mkdir(mode=0o755, exist_ok=True)
        try:
            file = os.open(place, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o444)
        except FileExistsError:
            continue
        with open(file, "w") as stream:
            stream.write(secrets.token_urlsafe(SECRET_BYTES))
        made.append(name)
    return made


def main(arguments: list[str]) -> int:
    if len(arguments) != 1 or not Path(arguments[0]).is_dir():
        sys.stderr.write("usage: python -m lockstep.server.cli.make_secrets FOLDER\n")
        return 2
    make_secrets(Path(arguments[0]))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
