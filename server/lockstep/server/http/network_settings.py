"""Network settings of the console: names, TLS, STUN and TURN."""

import ipaddress
from pathlib import Path
from typing import Annotated, Literal, Self
from urllib.parse import urlsplit

from pydantic import Field, SecretStr, field_validator, model_validator
from pydantic_settings import BaseSettings, NoDecode

from lockstep.server.webrtc.ice_servers import read_turn_uri

__all__ = ["NameList", "NetworkSettings"]

MIN_TURN_SECRET = 16  # characters

NameList = Annotated[tuple[str, ...], NoDecode]  # "a,b" in the environment


class NetworkSettings(BaseSettings):
    """Part of `Settings`. Times in seconds."""

    public_url: str = ""  # the console's address for people, "https://robot.example.org"; "": where it listens
    allowed_hosts: NameList = ()  # further names that requests may be for, as behind a proxy; "*" is any

    tls: Literal["", "self-signed"] = ""
    tls_names: NameList = ()  # further names and addresses for the self-signed certificate
    tls_cert: Path | None = None  # PEM, the chain
    tls_key: Path | None = None  # PEM

    stun: NameList = ()  # "stun:stun.example.org:3478"
    turn: NameList = ()  # "turn:turn.example.org:3478?transport=udp"
    turn_secret: SecretStr = SecretStr("")  # shared with the TURN server (coturn: static-auth-secret)
    turn_secret_file: Path | None = None  # instead of the above
    turn_seconds: Annotated[float, Field(ge=60, le=600)] = 600.0  # lifetime of a credential, unless its link ends
    relay_console: bool = False  # the console too asks STUN and TURN for its addresses

    @field_validator("allowed_hosts", "tls_names", "stun", "turn", mode="before")
    @classmethod
    def _split(cls, value: object) -> object:
        return tuple(part.strip() for part in value.split(",") if part.strip()) if isinstance(value, str) else value

    @field_validator("tls_cert", "tls_key", "turn_secret_file", mode="before")
    @classmethod
    def _no_path(cls, value: object) -> object:
        return None if value == "" else value

    @field_validator("public_url")
    @classmethod
    def _check_url(cls, value: str) -> str:
        parts = urlsplit(value)
        if value and (parts.scheme not in ("http", "https") or not parts.hostname or parts.path not in ("", "/")):
            raise ValueError(f"{value!r} is not http(s)://host[:port]")
        return value.rstrip("/")

    @field_validator("stun")
    @classmethod
    def _check_stun(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        for uri in value:
            if not uri.startswith(("stun:", "stuns:")) or len(uri.split(":", 1)[1]) == 0:
                raise ValueError(f"{uri!r} is not stun:host[:port]")
        return value

    @field_validator("turn")
    @classmethod
    def _check_turn(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        for uri in value:
            read_turn_uri(uri)
        return value

    @model_validator(mode="after")
    def _check_together(self) -> Self:
        if bool(self.tls_cert) != bool(self.tls_key):
            raise ValueError("tls_cert and tls_key belong together")
        if self.tls and self.tls_cert:
            raise ValueError("choose either a self-signed certificate or tls_cert and tls_key")
        if self.turn and len(self.turn_key) < MIN_TURN_SECRET:
            raise ValueError(f"turn needs a turn_secret of at least {MIN_TURN_SECRET} characters")
        return self

    @property
    def turn_key(self) -> str:
        """The secret that the console and the TURN server share; "" without TURN."""
        if self.turn_secret_file is not None:
            return self.turn_secret_file.read_text().strip()
        return self.turn_secret.get_secret_value()

    @property
    def encrypted(self) -> bool:
        """True if the console itself speaks TLS."""
        return bool(self.tls or self.tls_cert)

    @property
    def own_names(self) -> tuple[str, ...]:
        """Names, besides addresses, by which people may ask for the console."""
        host = urlsplit(self.public_url).hostname
        return tuple(name.lower() for name in (host, *self.allowed_hosts) if name and not _is_address(name))


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
