"""How relays are named, and what is refused."""

import pytest
from pydantic import ValidationError

from server.relay import relay_settings
from server.relay.relay_url import RelayUrl, parse_relay_url
from server.settings import Settings

LIVEKIT = "livekit:wss://host?room=demo"
KEYS = {"relay_key": "console", "relay_secret": "only for tests, 32 bytes or more"}


def test_a_janus_is_named_by_its_websocket_and_a_room() -> None:
    assert parse_relay_url("janus:ws://10.0.0.2:8188/4711") == RelayUrl("janus", "ws://10.0.0.2:8188", "4711")
    assert parse_relay_url("janus:wss://sfu.example.org/ws/12") == RelayUrl("janus", "wss://sfu.example.org/ws", "12")


def test_a_livekit_is_named_by_its_websocket_and_the_name_of_a_room() -> None:
    assert parse_relay_url(LIVEKIT) == RelayUrl("livekit", "wss://host", "demo")
    found = parse_relay_url("livekit:ws://10.0.0.2:7880/below/?room=Robot-1.a")
    assert found == RelayUrl("livekit", "ws://10.0.0.2:7880/below", "Robot-1.a")


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


@pytest.mark.parametrize(
    "text",
    [
        "livekit:wss://host",
        "livekit:wss://host?room=",
        "livekit:wss://host?room=a&room=b",
        "livekit:wss://host?room=a/b",
        "livekit:wss://host?room=" + "a" * 65,
        "livekit:https://host?room=demo",
        "livekit:wss://?room=demo",
        "livekit:wss://host?room=demo&secret=hush",
        "livekit:wss://key:hush@host?room=demo",
        "livekit:wss://host?room=demo#hush",
    ],
)
def test_what_names_no_livekit_is_refused_and_secrets_in_it_are_not_repeated(text: str) -> None:
    with pytest.raises(ValueError, match="livekit:") as refusal:
        parse_relay_url(text)
    assert "hush" not in str(refusal.value)


def test_pages_may_connect_to_the_relays_as_they_reach_them() -> None:
    settings = Settings(relay="janus:ws://a:8188/1,janus:ws://b:8188/1")  # type: ignore[arg-type]
    assert settings.relay_origins == ("ws://a:8188", "ws://b:8188")
    public = settings.model_copy(update={"relay_public": ("wss://a.example.org/ws", "wss://b.example.org")})
    assert public.relay_origins == ("wss://a.example.org", "wss://b.example.org")


def test_pages_may_ask_a_livekit_over_http_why_it_refused_them() -> None:
    settings = Settings(relay=LIVEKIT, **KEYS)  # type: ignore[arg-type]
    assert settings.relay_origins == ("wss://host", "https://host")


def test_public_addresses_name_every_relay_or_none() -> None:
    with pytest.raises(ValidationError, match="names every relay"):
        Settings(relay="janus:ws://a/1,janus:ws://b/1", relay_public="wss://a")  # type: ignore[arg-type]


def test_a_public_address_is_a_websocket() -> None:
    with pytest.raises(ValidationError, match="is not ws"):
        Settings(relay="janus:ws://a/1", relay_public="https://a")  # type: ignore[arg-type]


def test_a_livekit_needs_a_key_and_a_secret_that_is_long_enough() -> None:
    with pytest.raises(ValidationError, match="LOCKSTEP_RELAY_KEY, LOCKSTEP_RELAY_SECRET"):
        Settings(relay=LIVEKIT, relay_key="console")  # type: ignore[arg-type]
    with pytest.raises(ValidationError, match="fewer than 32 bytes") as refusal:
        Settings(relay=LIVEKIT, relay_key="console", relay_secret="hush")  # type: ignore[arg-type]
    assert "hush" not in refusal.value.errors()[0]["msg"]


def test_without_its_client_a_livekit_is_refused_with_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(relay_settings, "find_spec", lambda name: None if name == "livekit.rtc" else object())
    with pytest.raises(ValidationError, match=r"pip install -e '\.\[livekit\]'"):
        Settings(relay=LIVEKIT, **KEYS)  # type: ignore[arg-type]
