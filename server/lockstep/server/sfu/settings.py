"""Settings of the relays that observers watch through."""

from typing import Annotated, Literal, Self
from urllib.parse import urlsplit

from pydantic import Field, SecretStr, field_validator, model_validator
from pydantic_settings import BaseSettings

from lockstep.server.http.network_settings import NameList
from lockstep.server.sfu.relay_url import RelayUrl, parse_relay_url

__all__ = ["RelaySettings"]


class RelaySettings(BaseSettings):
    """Part of `Settings`."""

    # "janus:ws://host:8188/ROOM"; the first of several feeds the others
    relay: NameList = ()
    relay_public: NameList = ()  # the same relays as browsers reach them, "wss://relay.example.org"; empty: as above
    relay_admin_key: SecretStr = SecretStr("")  # key that Janus' video room requires to create a room
    relay_codec: Literal["", "H264", "VP8"] = ""  # codec of cameras; "": the one that is being encoded already
    observers_direct: Annotated[int, Field(ge=0)] = 10  # observers that the console serves itself, when it has relays

    max_relayed: Annotated[int, Field(ge=1)] = 1000  # observers behind relays that are connected for notes and STOP

    @field_validator("relay", "relay_public", mode="before")
    @classmethod
    def _split_relays(cls, value: object) -> object:
        return tuple(part.strip() for part in value.split(",") if part.strip()) if isinstance(value, str) else value

    @field_validator("relay")
    @classmethod
    def _check_relays(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        for each in value:
            parse_relay_url(each)
        return value

    @field_validator("relay_public")
    @classmethod
    def _check_public(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        for each in value:
            if urlsplit(each).scheme not in ("ws", "wss") or not urlsplit(each).hostname:
                raise ValueError(f"{each!r} is not ws(s)://host[:port]")
        return value

    @model_validator(mode="after")
    def _check_pairs(self) -> Self:
        if self.relay_public and len(self.relay_public) != len(self.relay):
            raise ValueError("relay_public names every relay, in the same order, or none")
        return self

    @property
    def relay_urls(self) -> list[RelayUrl]:
        return [parse_relay_url(each) for each in self.relay]

    @property
    def relay_origins(self) -> tuple[str, ...]:
        """Origins that a page may connect to besides its own server."""
        addresses = self.relay_public or tuple(each.address for each in self.relay_urls)
        parts = [urlsplit(address) for address in addresses]
        return tuple(dict.fromkeys(f"{part.scheme}://{part.netloc}" for part in parts))
