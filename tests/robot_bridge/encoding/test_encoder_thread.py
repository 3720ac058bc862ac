"""Jobs in the thread of an encoder, and what a system without room for a thread does to them."""

import asyncio
import threading
from collections.abc import Callable
from typing import NoReturn

import pytest

from lockstep.protocol.messages import Media
from lockstep.robot_bridge.encoding.encoder_thread import EncoderThread
from lockstep.robot_bridge.encoding.encoding_requests import EncodingGoal
from lockstep.robot_bridge.encoding.picture_encoding import EncodedPicture, PictureEncoding
from lockstep.robot_bridge.encoding.sound_encoding import SoundEncoding
from tests.waiting import PATIENCE


@pytest.fixture
def without_room() -> Callable[[], pytest.MonkeyPatch]:
    """Return a patch, to be undone, with which no thread starts."""

    def refuse(thread: threading.Thread) -> NoReturn:
        raise RuntimeError("can't start new thread")

    def begin() -> pytest.MonkeyPatch:
        patch = pytest.MonkeyPatch()
        patch.setattr(threading.Thread, "start", refuse)
        return patch

    return begin


async def test_a_job_for_which_there_was_no_thread_is_not_done_later(
    without_room: Callable[[], pytest.MonkeyPatch],
) -> None:
    thread, done = EncoderThread("encode-test"), list[tuple[int, str]]()

    def work(number: int) -> None:
        done.append((number, threading.current_thread().name))

    patch = without_room()
    refused = [thread.submit(work, number) for number in (1, 2)]
    patch.undo()
    assert [str(each) for each in refused] == ["can't start new thread"] * 2
    assert [thread.submit(work, number) for number in (3, 4)] == [None, None]
    await thread.close()
    assert [number for number, _ in done] == [3, 4]
    assert len({name for _, name in done}) == 1
    assert done[0][1].startswith("encode-test")


class Pictures:
    """An encoder of a robot's pictures, and what its links ask for."""

    def encode(self, media: Media, goal: EncodingGoal, keyframe: bool) -> EncodedPicture:
        return EncodedPicture(b"x", keyframe, 4, 2)

    def goal(self, stream: str) -> EncodingGoal:
        return EncodingGoal(1_000_000, 0.0, 1.0)

    def wants_keyframe(self, stream: str) -> bool:
        return True

    def keyframe_made(self, stream: str) -> None:
        pass


class Sounds:
    def encode(self, media: Media) -> list[Media]:
        return [media]


def media(stamp: int) -> Media:
    return Media(stream="front", codec="yuv420p", stamp=stamp, time=stamp / 30, payload=b"", width=4, height=2)


@pytest.mark.parametrize("kind", ["picture", "sound"])
async def test_what_came_while_there_was_no_room_for_a_thread_is_counted_and_the_next_is_encoded(
    kind: str, without_room: Callable[[], pytest.MonkeyPatch]
) -> None:
    counted, through = list[str](), list[int]()
    found: asyncio.Queue[int] = asyncio.Queue()

    def emit(encoded: Media) -> None:
        found.put_nowait(encoded.stamp)

    encoder = Pictures()
    encoding: PictureEncoding | SoundEncoding
    if kind == "picture":
        encoding = PictureEncoding(
            "front", encoder, encoder, lambda: True, emit, counted.append, lambda each: through.append(each.stamp)
        )
    else:
        encoding = SoundEncoding("ear", Sounds(), emit, counted.append)  # type: ignore[arg-type]  # has its `encode`
    running = asyncio.create_task(encoding.run())
    await asyncio.sleep(0)
    patch = without_room()
    encoding.put(media(1))
    patch.undo()
    assert counted == ["encoding_failed"]
    encoding.put(media(2))
    async with asyncio.timeout(PATIENCE):
        assert await found.get() == 2
    await asyncio.sleep(0)
    assert kind == "sound" or through == [1, 2]
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
