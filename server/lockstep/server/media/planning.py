"""Plans which streams go into which media sections, of an answer to a peer or of an offer to a relay. No I/O."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from lockstep.protocol.carriers import PLAYOUT_DELAY_URI, Carrier
from lockstep.rtc.peer import OfferedMedia
from lockstep.rtc.sdp import MID_URI, Codec, LocalMedia, MediaSection, SessionDescription
from lockstep.server.media.codecs.codec_choice import OPUS, chosen_codecs, known_codecs, offered_codecs
from lockstep.server.media.codecs.extensions import choose_carrier, wanted_uris
from lockstep.server.media.encoding.stream_encodings import StreamEncodings
from lockstep.server.media.pipeline.stream import Stream, VideoStream

__all__ = ["MediaPlan", "PlannedStream", "codec_in_use", "plan_answer", "plan_publication"]


class PlannedStream(NamedTuple):
    """One stream in a section of an answer, or of an offer to a relay."""

    mid: str
    stream: Stream
    codecs: tuple[Codec, ...]  # the one to send, and its repair codec if there is one
    carrier: Carrier


class MediaPlan(NamedTuple):
    """The media planned for a peer before its offer is answered."""

    media: dict[str, LocalMedia]  # by mid
    streams: list[PlannedStream]
    voice: str = ""  # mid of the section that receives the peer's own sound; "" without one
    thumbnail: bool = False


def plan_answer(
    streams: Sequence[Stream],
    offer: SessionDescription,
    *,
    trailer: bool,
    thumbnail: bool = False,
    voice: bool = False,
) -> MediaPlan:
    """Plan the media that answer an offer.

    The i-th video section gets the i-th camera, the i-th audio section the i-th microphone; sections without one, or
    without a codec that it has, are answered inactive. `trailer` asks for the trailer carrier; otherwise the offer's
    header extensions decide. `thumbnail`: the first camera alone, in the lowest tier. `voice`: the first audio section
    in which the peer would only send receives its own sound.
    """
    sources: dict[str, Iterator[Stream]] = {
        kind: iter([stream for stream in streams if stream.kind == kind][: 1 if thumbnail else None])
        for kind in (("video",) if thumbnail else ("video", "audio"))
    }
    plan = MediaPlan({}, [], thumbnail=thumbnail)
    for section in offer.sections:
        if not section.is_media:
            continue
        if section.direction == "sendonly":
            if voice and not plan.voice and chosen_codecs(section, (OPUS.name,)):
                plan = plan._replace(voice=section.mid)
                plan.media[section.mid] = LocalMedia((OPUS,), "recvonly", (MID_URI,))
            else:
                plan.media[section.mid] = _inactive(section)
            continue
        planned = _planned(section, next(sources.get(section.kind, iter(())), None), trailer)
        plan.media[section.mid] = _inactive(section) if planned is None else _sent(planned)
        plan.streams.extend([] if planned is None else [planned])
    return plan


def _planned(section: MediaSection, stream: Stream | None, trailer: bool) -> PlannedStream | None:
    if stream is None or section.direction not in ("recvonly", "sendrecv"):
        return None
    h264_first = isinstance(stream, VideoStream) and stream.gives_h264
    codecs = chosen_codecs(section, stream.encodings.codecs, h264_first=h264_first)
    if not codecs:
        return None
    carrier = choose_carrier({each.uri for each in section.extensions}, trailer)
    return PlannedStream(section.mid, stream, codecs, carrier)


def plan_publication(streams: Sequence[Stream], camera_codec: str = "") -> tuple[MediaPlan, list[OfferedMedia]]:
    """Plan every stream for a relay, each in one codec and with trailers; return the plan and the media to offer.

    `camera_codec`: "" selects a codec that is already encoded for somebody, so that it costs no encoder.
    """
    plan, offered = MediaPlan({}, []), []
    for number, stream in enumerate(streams):
        name = codec_in_use(stream.encodings, camera_codec if stream.kind == "video" else "")
        planned = PlannedStream(str(number), stream, offered_codecs(stream.kind, name), "trailer")
        plan.streams.append(planned)
        # A relay forwards playout-delay, so that browsers show pictures at once.
        uris = (MID_URI, PLAYOUT_DELAY_URI) if stream.kind == "video" else (MID_URI,)
        offered.append(OfferedMedia(planned.mid, stream.kind, replace(_sent(planned), extensions=uris)))
    return plan, offered


def codec_in_use(encodings: StreamEncodings, wanted: str = "") -> str:
    """Return `wanted` if available; else a codec that is already encoded for peers, or the best one."""
    if wanted in encodings.codecs:
        return wanted
    return next((each.codec for each in encodings.own if each.targets), encodings.codecs[0])


def _inactive(section: MediaSection) -> LocalMedia:
    return LocalMedia(known_codecs(section.kind), "inactive")


def _sent(planned: PlannedStream) -> LocalMedia:
    name = _msid(planned.stream.name)
    uris = wanted_uris(planned.stream.kind, planned.carrier)
    return LocalMedia(planned.codecs, "sendonly", uris, msid=f"{name} {name}")


def _msid(name: str) -> str:
    """`name` as a media stream id: only the characters of RFC 8830 2 (token-char), at most 64."""
    return re.sub(r"[^0-9A-Za-z!#$%&'*+.^_`{|}~-]", "_", name)[:64] or "_"
