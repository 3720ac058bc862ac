"""The encoders of all streams of a robot, between its media sources and the links."""

import asyncio
from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Protocol

import msgspec

from lockstep.protocol.actions import StatusItem
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import EncodeRequest, Media
from lockstep.robot_bridge.encoding.encoder_choice import SOFTWARE, EncodeSettings, log_fallback
from lockstep.robot_bridge.encoding.encoding_requests import EncodingRequests
from lockstep.robot_bridge.encoding.picture_encoding import PictureEncoding

if TYPE_CHECKING:  # it needs PyAV
    from lockstep.robot_bridge.encoding.picture_encoder import H264Encoder
    from lockstep.robot_bridge.encoding.sound_encoding import SoundEncoding

__all__ = ["MediaEncoding", "MediaLinks"]


RAW = ("yuv420p", "mjpeg", "pcm_s16le")
# s of the bitrate, at most, that a picture of a second encoding takes at once. It is the time until the operator's next
# picture where that is less: a keyframe has then left an uplink with room for both before that picture comes.
SECOND_KEYFRAME_SECONDS = 0.1
MAX_REASON = 200  # characters


class MediaLinks(Protocol):
    """Where encoded media go."""

    def media_have_room(self) -> bool: ...
    def second_has_room(self, stream: str) -> bool: ...
    def publish_media(self, media: Media) -> None: ...


class MediaEncoding:
    """Encodes each camera's raw and JPEG pictures to H.264, and sound to Opus; passes all else on as it is.

    While a link asks for a camera's second encoding, each picture is encoded once more, when the first encoding is
    through with it and the links take more. So a second encoding is what a narrow uplink or a slow processor loses
    first.

    Await `run`. The link server calls `joined`, `asked`, `left` and `lost`, the media sources `put`.
    """

    codecs: tuple[str, ...] = ("h264", "opus")
    encodings = 2

    def __init__(self, settings: EncodeSettings, description: RobotDescription, counts: Counter[str]) -> None:
        """`counts`: pictures that were left out, by reason."""
        self._settings = settings
        self._description = description
        self._counts = counts
        streams = [each.name for each in description.cameras] + [each.name for each in description.microphones]
        self._requests: EncodingRequests[object] = EncodingRequests(streams)
        self._second_requests: EncodingRequests[object] = EncodingRequests(streams)
        self._second: dict[str, PictureEncoding] = {}  # by camera
        self._encoders: list[H264Encoder] = []
        self._fallback = ""  # why the software encoder took the place of the one in the settings; "": it has not
        self._logged: set[str] = set()  # all such reasons so far; each encoder adds one at most
        self._streams: dict[str, PictureEncoding | SoundEncoding] = {}
        self._publish: Callable[[Media], None] = lambda media: None

    def joined(self, link: object) -> None:
        """A media link was admitted."""
        self._requests.joined(link)
        self._second_requests.joined(link)

    def left(self, link: object) -> None:
        """A link ended."""
        self._requests.left(link)
        self._second_requests.left(link)

    def lost(self, stream: str, *, second: bool = False) -> None:
        """A link missed pictures of a stream, or of its second encoding, and needs a keyframe."""
        (self._second_requests if second else self._requests).lost(stream)

    def takes_second(self, link: object, stream: str) -> bool:
        """Return whether a link has asked for the second encoding of a stream."""
        return self._second_requests.takes(link, stream)

    def asked(self, link: object, request: EncodeRequest) -> None:
        """Take what a link asks for."""
        self._requests.asked(link, request)
        second = self._second_requests
        began = [each.stream for each in request.second if not second.takes(link, each.stream)]
        second.asked(link, EncodeRequest(streams=request.second))
        for stream in began:  # a link that begins to take it can decode nothing before a keyframe
            second.lost(stream)

    def status(self) -> list[StatusItem]:
        """Return what a person should know: that another encoder than the one in the settings is at work."""
        if not self._fallback:
            return []
        return [
            StatusItem(
                name="encoder_fallback",
                label="Picture encoder",
                value=SOFTWARE,
                level="warning",
                text=self._fallback[:MAX_REASON],
            )
        ]

    async def _try_encoder(self) -> None:
        """Try the encoder of the settings before a picture needs it."""
        from lockstep.robot_bridge.encoding.encoder_trial import try_in_time  # needs PyAV

        if self._settings.encoder == SOFTWARE or not self._encoders:
            return
        why = await try_in_time(self._settings.encoder)
        if why:
            for encoder in self._encoders:
                encoder.fall_back(why)

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
            name = camera.name
            encoder = partial(H264Encoder, self._settings.encoder, camera.frame_rate, fell_back=self._fell_back)
            interval = 1 / camera.frame_rate if camera.frame_rate > 0 else SECOND_KEYFRAME_SECONDS
            first, second = encoder(), encoder(keyframe_seconds=min(SECOND_KEYFRAME_SECONDS, interval))
            self._encoders += [first, second]
            self._second[name] = PictureEncoding(
                name,
                second,
                self._second_requests,
                partial(links.second_has_room, name),
                lambda media: links.publish_media(msgspec.structs.replace(media, second=True)),
                lambda reason: self._counts.update([f"second_{reason}"]),
            )
            self._streams[name] = PictureEncoding(
                name,
                first,
                self._requests,
                links.media_have_room,
                self._publish,
                lambda reason: self._counts.update([reason]),
                self._put_second,
            )

    def _fell_back(self, why: str) -> None:
        """Note why, and log each reason once for all encoders; called in an encoder's thread, or on the loop."""
        if why not in self._logged:
            self._logged.add(why)
            log_fallback(why)
        self._fallback = why

    def _put_second(self, media: Media) -> None:
        if self._second_requests.is_asked(media.stream):
            self._second[media.stream].put(media)

    async def run(self) -> None:
        """Run the encoders until cancelled."""
        await self._try_encoder()
        async with asyncio.TaskGroup() as tasks:
            for each in (*self._streams.values(), *self._second.values()):
                tasks.create_task(each.run())
            await asyncio.get_running_loop().create_future()

    def put(self, media: Media) -> None:
        """Take a medium as its source made it."""
        encoding = self._streams.get(media.stream)
        if encoding is not None and media.codec in RAW:
            encoding.put(media)
        else:
            self._publish(media)
