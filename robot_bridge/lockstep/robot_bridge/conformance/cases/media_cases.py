"""Cases about pictures and sound."""

from collections.abc import Iterable

from lockstep.protocol.messages import LinkMessage, Media
from lockstep.protocol.serial import is_newer
from lockstep.robot_bridge.conformance.case import Case
from lockstep.robot_bridge.conformance.driver import Driver
from lockstep.robot_bridge.conformance.errors import expect
from lockstep.robot_bridge.conformance.subject import Subject, described, needs
from lockstep.robot_bridge.conformance.waiting import PATIENCE, within

__all__ = ["MEDIA_CASES"]

SOUND = ("pcm_s16le", "opus")
STAMPS = 5  # different ones that are judged
STREAMS = "the robot has no cameras and no microphones"


async def _media_role(subject: Subject) -> None:
    async with subject.link("media") as (watcher, hello):
        description = described(hello)
        cameras = {camera.name for camera in description.cameras}
        sounds = {microphone.name for microphone in description.microphones}
        needs(bool(cameras | sounds), STREAMS)
        silent = cameras | sounds
        async with within(PATIENCE, "a stream of the description does not come"):
            while silent:
                media = await watcher.find(Media)
                expect(media.stream in cameras | sounds, f"a stream {media.stream!r}, which is not described")
                _check_shape(media, media.stream in sounds)
                silent.discard(media.stream)


def _check_shape(media: Media, is_sound: bool) -> None:
    expect((media.codec in SOUND) == is_sound, f"{media.codec} in the stream {media.stream!r}")
    if is_sound:
        expect(media.sample_rate > 0 and media.channels > 0, "sound without its sample rate or channels")
        expect(
            media.codec == "opus" or len(media.payload) % (2 * max(media.channels, 1)) == 0,
            "a sound segment that ends inside a sample",
        )
        return
    width, height = media.width, media.height
    expect(width > 0 and height > 0, "a picture without its size")
    if media.codec == "yuv420p":
        size = width * height + 2 * ((width + 1) // 2) * ((height + 1) // 2)
        expect(len(media.payload) == size, f"a picture of {width}x{height} with {len(media.payload)} bytes, not {size}")


async def _stamps(subject: Subject) -> None:
    """A picture must have been captured when its event's first feedback was measured, or later."""
    async with subject.operator() as driver, subject.link("media") as (watcher, _):
        description = driver.description
        needs(bool(description.cameras or description.microphones), STREAMS)
        seen: list[tuple[int, float]] = []
        async with within(PATIENCE, f"no media of {STAMPS} different events"):
            while len({stamp for stamp, _ in seen}) < STAMPS:
                await driver.drive(driver.neutral)
                seen += _captured(watcher.drain())
        await driver.fresh()
        _judge(driver, seen)


def _captured(messages: Iterable[LinkMessage]) -> list[tuple[int, float]]:
    return [(message.stamp, message.time) for message in messages if isinstance(message, Media)]


def _judge(driver: Driver, seen: list[tuple[int, float]]) -> None:
    current = driver.feedback.event
    for stamp, captured in seen:
        expect(not is_newer(stamp, current), f"a medium is stamped {stamp}, and {current} is the newest event")
        if (began := driver.began.get(stamp)) is not None:
            expect(
                began <= captured,
                f"a medium is stamped {stamp} and was captured {began - captured:.3f} s before that event",
            )


MEDIA_CASES: tuple[Case, ...] = (
    Case(
        "media_role",
        "every stream of the description comes, in its shape",
        "media, bridge to media subscribers",
        _media_role,
    ),
    Case("stamps", "a stamp is never newer than the event at capture", "Media", _stamps),
)
