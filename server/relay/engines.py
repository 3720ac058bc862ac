"""The kinds of relay that the settings name."""

from collections.abc import Mapping

from server.relay.janus_engine import JanusEngine
from server.relay.janus_publishing import Connect, PublishedMedia
from server.relay.publication import Engine
from server.relay.relay_settings import RelaySettings
from server.relay.relay_url import EngineName

__all__ = ["relay_engines"]


def relay_engines(
    settings: RelaySettings, endpoint: Connect, media: PublishedMedia, key: str
) -> Mapping[EngineName, Engine]:
    """`key`: the console's own, from which those of rooms are made."""
    return {"janus": JanusEngine(settings, endpoint, media, key)}
