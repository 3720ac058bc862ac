"""Settings of the live session for Rerun: LOCKSTEP_RERUN__…"""

from pathlib import Path
from typing import Annotated, Literal, NamedTuple, Self
from urllib.parse import urlsplit

from pydantic import BaseModel, Field, model_validator

__all__ = ["RerunSettings", "Target", "target_of"]

SCHEMES = ("rerun+http", "rerun+https", "rerun")
SUFFIX = ".rrd"
VIEWER_PORT = 9876  # that Rerun's viewer listens on


class Target(NamedTuple):
    """Where the session goes."""

    kind: Literal["file", "viewer", "server"]
    value: str  # path of the file; address of the viewer; port that is served


class RerunSettings(BaseModel):
    """Where the session goes. Rerun's server listens on every address, and asks for no link: it needs `public`."""

    to: str | None = None  # None: nowhere. FILE.rrd; rerun+http://HOST:PORT/proxy, or HOST:PORT, of a viewer; PORT
    public: bool = False  # serve where other machines connect too
    file_bytes: Annotated[int, Field(ge=1_000_000)] = 2_000_000_000  # a file ends when it is larger

    @property
    def served_port(self) -> int | None:
        """The port of Rerun's server; None: there is none."""
        kind, value = target_of(self.to) if self.to is not None else ("", "")
        return int(value) if kind == "server" else None

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.to is not None and target_of(self.to).kind == "server" and not self.public:
            raise ValueError(
                f"Rerun's server on port {self.to} would show pictures without a link to everybody who reaches this "
                "machine, on all its addresses; set public (LOCKSTEP_RERUN__PUBLIC=true) if that is wanted, or start "
                f"Rerun's viewer and give its address, 127.0.0.1:{VIEWER_PORT}"
            )
        return self


def target_of(to: str) -> Target:
    """Return where `to` leads.

    Raises:
        ValueError: nowhere.
    """
    if to.endswith(SUFFIX) and "://" not in to:
        return Target("file", str(Path(to).absolute()))
    if to.isascii() and to.isdigit():
        if not 0 < int(to) <= 65535:
            raise ValueError(f"{to} is not a port")
        return Target("server", to)
    url = to if "://" in to else f"rerun+http://{to}/proxy"
    parts = urlsplit(url)
    try:
        known = parts.scheme in SCHEMES and bool(parts.hostname) and parts.port is not None
    except ValueError:
        known = False
    if not known or parts.path != "/proxy":
        raise ValueError(f"{to!r} is not FILE.rrd, HOST:PORT, rerun+http://HOST:PORT/proxy, or a PORT to serve")
    return Target("viewer", url)
