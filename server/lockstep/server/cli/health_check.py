"""Asks the console on this machine whether it is well: `python -m lockstep.server.cli.health_check`, for containers.

It reads the same settings as the console. The exit status is 0 when /healthz says so.
"""

import ssl
import sys
from urllib.error import URLError
from urllib.request import urlopen

from lockstep.server.settings import Settings
from lockstep.server.settings_file import SettingsFileUnusable

__all__ = ["health_url", "main"]

SECONDS = 2.0


def health_url(settings: Settings) -> str:
    """Return the URL of /healthz: on loopback, unless the console listens on one address only."""
    host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(settings.host, settings.host)
    shown = f"[{host}]" if ":" in host else host
    return f"{'https' if settings.encrypted else 'http'}://{shown}:{settings.port}/healthz"


def main() -> int:
    here = ssl.create_default_context()
    here.check_hostname, here.verify_mode = False, ssl.CERT_NONE  # it asks itself: the certificate's owner is known
    try:
        with urlopen(health_url(Settings()), timeout=SECONDS, context=here) as answer:
            return 0 if answer.status == 200 else 1
    except (URLError, OSError, SettingsFileUnusable) as error:
        sys.stderr.write(f"{error}\n")
        return 1


if __name__ == "__main__":
    sys.exit(main())
