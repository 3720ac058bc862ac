"""Sends messages of the bridge to the admitted links, by role."""

import time
from collections.abc import Callable
from functools import cache
from typing import Protocol

import msgspec

from lockstep.protocol.actions import Status
from lockstep.protocol.framing import frame
from lockstep.protocol.maps import Navigation, OccupancyMap
from lockstep.protocol.messages import EventNotice, Feedback, LinkMessage, Media, encode_message
from lockstep.protocol.traces.trace import PictureSpans, span_ms
from lockstep.robot_bridge.link.admission.link_admission import LinkAdmission
from lockstep.robot_bridge.link.link_transport import LinkTransport

__all__ = ["LinkPublisher", "StreamEncoding", "encode_once", "encode_waited"]


class StreamEncoding(Protocol):
    """The part of a bridge that encodes media, as far as their way to the links concerns it."""

    def lost(self, stream: str, *, second: bool = False) -> None:
        """A media link could not take pictures of a stream, or of its second encoding, and needs a keyframe."""

    def takes_second(self, link: object, stream: str) -> bool:
        """Whether a link has asked for the second encoding of a stream."""


class LinkPublisher:
    """Each message is encoded once for all links that get it. No link waits for another."""

    def __init__(self, admitted: LinkAdmission[LinkTransport], encoding: StreamEncoding | None) -> None:
        """`encoding`: hears which pictures were dropped; None: media are sent as they are."""
        self._admitted = admitted
        self._encoding = encoding
        self._map: Callable[[], bytes] | None = None  # the frame of the newest map; None before the first

    def publish_feedback(self, feedback: Feedback) -> None:
        """Send a feedback to the operator link, and its event to the event links."""
        self.publish_to_operator(feedback)
        if self._admitted.events:
            notice = encode_once(EventNotice(event=feedback.event, time=feedback.time))
            for peer in self._admitted.events:
                peer.send_encoded("event", notice)

    def publish_to_operator(self, message: Feedback | Status | Navigation) -> None:
        """Send to the operator link, if there is one."""
        if self._admitted.operator is not None:
            self._admitted.operator.send(message)

    def publish_map(self, map: OccupancyMap) -> None:
        """Send a map to every media link, and to those that open later."""
        self._map = encode_once(map)
        for peer in self._admitted.media:
            peer.send_encoded("map", self._map)

    def link_opened(self, peer: LinkTransport) -> None:
        """Send the newest map to a new media link."""
        if self._map is not None and peer in self._admitted.media:
            peer.send_encoded("map", self._map)

    def publish_media(self, media: Media) -> None:
        """Send a medium to every media link, of a second encoding to those that take it; newest wins per stream."""
        encoded = encode_once(media) if media.spans is msgspec.UNSET else encode_waited(media, time.monotonic)
        peers = self._takers_of_second(media.stream) if media.second else self._admitted.media
        complete = [peer.output.write_media(media, encoded) for peer in peers]
        if self._encoding is not None and not all(complete):
            self._encoding.lost(media.stream, second=media.second)

    def media_have_room(self) -> bool:
        """Return whether some media link takes a picture at once. Others that do not miss pictures up to a keyframe."""
        return any(peer.output.has_room for peer in self._admitted.media)

    def second_has_room(self, stream: str) -> bool:
        """Return whether a picture of the second encoding of a stream would wait nowhere on its way to its links.

        So a second encoding takes only what the first leaves, and does not wait for the console to see that.
        """
        takers = self._takers_of_second(stream)
        return bool(takers) and all(peer.output.path_is_clear for peer in takers)

    def _takers_of_second(self, stream: str) -> list[LinkTransport]:
        encoding = self._encoding
        if encoding is None:
            return []
        return [peer for peer in self._admitted.media if encoding.takes_second(peer, stream)]


def encode_waited(media: Media, clock: Callable[[], float]) -> Callable[[], bytes]:
    """As `encode_once`, with the time until that first call, when a link takes the picture, among its spans."""
    since = clock()

    def make() -> bytes:
        spans = msgspec.UNSET if media.spans is msgspec.UNSET else _waited(media.spans, clock() - since)
        return frame(encode_message(msgspec.structs.replace(media, spans=spans)))

    return cache(make)


def _waited(spans: PictureSpans, seconds: float) -> PictureSpans:
    return msgspec.structs.replace(spans, link_wait_ms=span_ms(seconds))


def encode_once(message: LinkMessage) -> Callable[[], bytes]:
    """Return a function that encodes the message's frame at the first call and returns the same frame at the others."""
    return cache(lambda: frame(encode_message(message)))
