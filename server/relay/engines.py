"""The kinds of relay that the settings name."""

from collections.abc import Mapping
from typing import Protocol

from server.relay.janus_engine import JanusEngine
from server.relay.janus_publishing import PublishedMedia
from server.relay.livekit_engine import HandedOverMedia, LiveKitEngine
from server.relay.publication import Engine
from server.relay.relay_settings import RelaySettings
from server.relay.relay_url import EngineName

__all__ = ["RelayMediaPlane", "relay_engines"]


class RelayMediaPlane(PublishedMedia, HandedOverMedia, Protocol):
    """What all of them together need of the media plane."""


def relay_engines(settings: RelaySettings, media: RelayMediaPlane, key: str) -> Mapping[EngineName, Engine]:
    """`key`: the console's own, from which those of rooms are made."""
    return {"janus": JanusEngine(settings, media, key), "livekit": LiveKitEngine(settings, media)}
