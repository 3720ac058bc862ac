"""The encoders of all streams of a robot, between its media sources and the links."""

import asyncio
from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import EncodeRequest, Media
from lockstep.robot_bridge.encoding.encoder_choice import EncodeSettings
from lockstep.robot_bridge.encoding.encoding_requests import EncodingRequests
from lockstep.robot_bridge.encoding.picture_encoding import PictureEncoding

if TYPE_CHECKING:  # it needs PyAV
    from lockstep.robot_bridge.encoding.sound_encoding import SoundEncoding

__all__ = ["MediaEncoding", "MediaLinks"]


RAW = ("yuv420p", "mjpeg", "pcm_s16le")


class MediaLinks(Protocol):
    """Where encoded media go."""

    def media_have_room(self) -> bool: ...
    def publish_media(self, media: Media) -> None: ...


class MediaEncoding:
    """Encodes each camera's raw and JPEG pictures to H.264, and sound to Opus; passes all else on as it is.

    Await `run`. The link server calls `joined`, `asked`, `left` and `lost`, the media sources `put`.
    """

    codecs: tuple[str, ...] = ("h264", "opus")

    def __init__(self, settings: EncodeSettings, description: RobotDescription, counts: Counter[str]) -> None:
        """`counts`: pictures that were left out, by reason."""
        self._settings = settings
        self._description = description
        self._counts = counts
        streams = [each.name for each in description.cameras] + [each.name for each in description.microphones]
        self._requests: EncodingRequests[object] = EncodingRequests(streams)
        self._streams: dict[str, PictureEncoding | SoundEncoding] = {}
        self._publish: Callable[[Media], None] = lambda media: None

    def joined(self, link: object) -> None:
        """A media link was admitted."""
        self._requests.joined(link)

    def left(self, link: object) -> None:
        """A link ended."""
        self._requests.left(link)

    def lost(self, stream: str) -> None:
        """A link missed pictures, and needs a keyframe."""
        self._requests.lost(stream)

    def asked(self, link: object, request: EncodeRequest) -> None:
        """Take what a link asks for."""
        self._requests.asked(link, request)

    def send_to(self, links: MediaLinks) -> None:
        """Set where encoded media go; call before `run`."""
        from lockstep.robot_bridge.encoding.picture_encoder import H264Encoder  # needs PyAV
        from lockstep.robot_bridge.encoding.sound_encoder import OpusEncoder
        from lockstep.robot_bridge.encoding.sound_encoding import SoundEncoding

        self._publish = links.publish_media
        for microphone in self._description.microphones:
            self._streams[microphone.name] = SoundEncoding(
                microphone.name, OpusEncoder(), self._publish, lambda reason: self._counts.update([reason])
            )
        for camera in self._description.cameras:
            self._streams[camera.name] = PictureEncoding(
                camera.name,
                H264Encoder(self._settings.encoder, camera.frame_rate),
                self._requests,
                links.media_have_room,
                self._publish,
                lambda reason: self._counts.update([reason]),
            )

    async def run(self) -> None:
        """Run the encoders until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            for each in self._streams.values():
                tasks.create_task(each.run())
            await asyncio.get_running_loop().create_future()

    def put(self, media: Media) -> None:
        """Take a medium as its source made it."""
        encoding = self._streams.get(media.stream)
        if encoding is not None and media.codec in RAW:
            encoding.put(media)
        else:
            self._publish(media)
