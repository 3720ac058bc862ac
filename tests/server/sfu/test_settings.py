"""How relays are named, and what is refused."""

import pytest
from pydantic import ValidationError

from lockstep.server.settings import Settings
from lockstep.server.sfu.relay_url import RelayUrl, parse_relay_url


def test_a_janus_is_named_by_its_websocket_and_a_room() -> None:
    assert parse_relay_url("janus:ws://10.0.0.2:8188/4711") == RelayUrl("ws://10.0.0.2:8188", 4711)
    assert parse_relay_url("janus:wss://sfu.example.org/ws/12") == RelayUrl("wss://sfu.example.org/ws", 12)


@pytest.mark.parametrize(
    "text",
    [
        "ws://host/1",
        "sfu:ws://host/1",
        "janus:http://host/1",
        "janus:ws:///1",
        "janus:ws://host",
        "janus:ws://host/room",
        "janus:ws://host/1?pin=x",
        "janus:ws://user:secret@host/1",
        f"janus:ws://host/{2**53}",
    ],
)
def test_anything_else_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="janus"):
        parse_relay_url(text)


@pytest.mark.parametrize("text", ["livekit:wss://host?room=demo", "sfu:wss://host?secret=hush", "wss://host/1"])
def test_another_engine_is_refused_with_what_a_relay_is_and_its_address_is_not_repeated(text: str) -> None:
    with pytest.raises(ValidationError, match=r"must be a Janus server: janus:ws\(s\)://host\[:port\]/ROOM") as refusal:
        Settings(relay=text)  # type: ignore[arg-type]
    assert "host?" not in refusal.value.errors()[0]["msg"]


def test_pages_may_connect_to_the_relays_as_they_reach_them() -> None:
    settings = Settings(relay="janus:ws://a:8188/1,janus:ws://b:8188/1")  # type: ignore[arg-type]
    assert settings.relay_origins == ("ws://a:8188", "ws://b:8188")
    public = settings.model_copy(update={"relay_public": ("wss://a.example.org/ws", "wss://b.example.org")})
    assert public.relay_origins == ("wss://a.example.org", "wss://b.example.org")


def test_public_addresses_name_every_relay_or_none() -> None:
    with pytest.raises(ValidationError, match="names every relay"):
        Settings(relay="janus:ws://a/1,janus:ws://b/1", relay_public="wss://a")  # type: ignore[arg-type]


def test_a_public_address_is_a_websocket() -> None:
    with pytest.raises(ValidationError, match="is not ws"):
        Settings(relay="janus:ws://a/1", relay_public="https://a")  # type: ignore[arg-type]
