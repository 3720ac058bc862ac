"""Decodes the content of a record: a picture, a sound, or one of Lockstep's own records. No I/O."""

from typing import NamedTuple, TypeVar

import msgspec
from foxglove_schemas_protobuf.CompressedAudio_pb2 import CompressedAudio
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.RawAudio_pb2 import RawAudio
from google.protobuf.message import DecodeError

from lockstep.server.recording.errors import RecordingDamaged
from lockstep.server.recording.format.records import OWN_RECORDS, OwnRecord

__all__ = [
    "SOUND",
    "VIDEO",
    "RecordedPicture",
    "RecordedSound",
    "own_record",
    "own_record_of",
    "payload_of",
    "picture_of",
    "sound_of",
]

VIDEO = "foxglove.CompressedVideo"
SOUND: dict[str, type[CompressedAudio | RawAudio]] = {
    "foxglove.CompressedAudio": CompressedAudio,
    "foxglove.RawAudio": RawAudio,  # G.711 in earlier files
}
MEDIA: dict[str, type[CompressedVideo | CompressedAudio | RawAudio]] = {VIDEO: CompressedVideo, **SOUND}
IDR, SLICE = 5, 1  # ITU-T H.264 table 7-1
NAL_KIND = 0x1F
START_CODE = b"\x00\x00\x01"
VP8_START = b"\x9d\x01\x2a"  # RFC 6386 9.1, behind the frame tag of a keyframe

Kind = TypeVar("Kind", bound=OwnRecord)
_decoders = {kind: msgspec.json.Decoder(kind) for kind in OWN_RECORDS.values()}


def payload_of(schema: str, data: bytes) -> bytes:
    """Return the bare encoded picture or sound; of every other schema the message itself.

    Raises:
        RecordingDamaged: it is not what the schema says.
    """
    kind = MEDIA.get(schema)
    if kind is None:
        return data
    try:
        return kind.FromString(data).data
    except DecodeError as error:
        raise RecordingDamaged(f"not a {schema}") from error


class RecordedPicture(NamedTuple):
    format: str  # "h264", "vp8"
    data: bytes
    keyframe: bool


def picture_of(data: bytes) -> RecordedPicture:
    """Return the picture in a message of the schema VIDEO. Raises RecordingDamaged."""
    try:
        found = CompressedVideo.FromString(data)
    except DecodeError as error:
        raise RecordingDamaged(f"not a {VIDEO}") from error
    return RecordedPicture(found.format, found.data, _is_keyframe(found.format, found.data))


class RecordedSound(NamedTuple):
    format: str  # "opus", "g711-ulaw"
    data: bytes


def sound_of(schema: str, data: bytes) -> RecordedSound:
    """Return the sound in a message of one of the schemas SOUND. Raises RecordingDamaged."""
    try:
        found = SOUND[schema].FromString(data)
    except DecodeError as error:
        raise RecordingDamaged(f"not a {schema}") from error
    return RecordedSound(found.format, found.data)


def _is_keyframe(picture_format: str, picture: bytes) -> bool:
    if picture_format == "vp8":
        return len(picture) > 6 and not picture[0] & 1 and picture[3:6] == VP8_START
    return _has_idr(picture)


def own_record(kind: type[Kind], data: bytes) -> Kind:
    """Decode one of Lockstep's own records. Raises RecordingDamaged."""
    try:
        found: Kind = _decoders[kind].decode(data)  # type: ignore[assignment]
    except (msgspec.DecodeError, UnicodeError, RecursionError) as error:
        raise RecordingDamaged(f"not a {kind.__name__}: {error}") from error
    return found


def own_record_of(schema: str, data: bytes) -> OwnRecord | None:
    """Decode one of Lockstep's own records; None for other schemas. Raises RecordingDamaged."""
    kind = OWN_RECORDS.get(schema)
    return None if kind is None else own_record(kind, data)


def _has_idr(picture: bytes) -> bool:
    """True if an H.264 access unit in Annex B is a keyframe: its first slice is one of an IDR picture."""
    at = picture.find(START_CODE)
    while 0 <= at < len(picture) - len(START_CODE):
        kind = picture[at + len(START_CODE)] & NAL_KIND
        if kind in (SLICE, IDR):
            return kind == IDR
        at = picture.find(START_CODE, at + len(START_CODE))
    return False
