"""The client on a real console and bridge, over real WebRTC on loopback."""

import asyncio
from typing import Any

import pytest

from lockstep.bench.harness.driving import drive_on
from lockstep.client import (
    CommandError,
    CommandRefused,
    Console,
    ConsoleLost,
    NoSuchStream,
    NotArmed,
    SeatRefused,
    SignallingRefused,
)
from lockstep.protocol.carriers import Carrier
from lockstep.protocol.traces.trace import known_spans
from lockstep.protocol.traces.trace_messages import Traces
from tests.client.live.truth import collecting, drawn_event, executed_after, logged_stamps, until_logged
from tests.support.stack import Stack

pytestmark = pytest.mark.asyncio(loop_scope="module")

EVENTS, MOST_EVENTS = 40, 400
STAMPS = EVENTS // 3
CARRIERS: list[tuple[Carrier, str]] = [
    ("native", "VP8"),
    ("native", "H264"),
    ("trailer", "VP8"),
    ("trailer", "H264"),
    ("capture-time", "VP8"),
]


def _stamps(media: list[Any]) -> set[int]:
    return {medium.stamp for medium in media}


@pytest.mark.parametrize(("carrier", "codec"), CARRIERS)
async def test_every_stamp_is_the_truth(stack: Stack, carrier: Carrier, codec: str) -> None:
    async with Console(stack.operator, carrier=carrier, codec=codec) as console:
        await console.take_seat()
        async with collecting(console) as found:
            for number in range(MOST_EVENTS):
                feedback = await drive_on(console, {"base.wz": 0.5 if number % 20 < 10 else -0.5})
                if number >= EVENTS and min(len(_stamps(media)) for media in found.values()) > STAMPS:
                    break
        figures = console.stats()
        for name, media in found.items():
            assert len(_stamps(media)) > STAMPS, name
            assert _stamps(media) <= await logged_stamps(stack, name, feedback.event)
        for camera in console.description.cameras:
            drawn = [(picture.stamp, drawn_event(picture)) for picture in found[camera.name]]
            assert all(stamp == event for stamp, event in drawn), drawn
    for stream in figures.streams:
        assert (stream.carrier, stream.unstamped, stream.lost) == (carrier, 0, 0)
        assert stream.max_gap <= (4 if stream.kind == "video" else 6)
        assert stream.codec == (codec if stream.kind == "video" else "opus")


async def test_each_feedback_answers_its_own_command(stack: Stack) -> None:
    async with Console(stack.operator, video=False, audio=False) as console:
        await console.take_seat()
        sent = [[0.1 + number / 1000, 0.0, 0.0] for number in range(10)]
        events = [(await drive_on(console, values)).event for values in sent]
        assert events == sorted(set(events))  # where a busy machine waits, neutral ones come in between
        figures = console.stats().command_to_feedback_ms
        assert figures.count >= 10
        executed = [record for record in await stack.events("executed") if record["event"] in events]
    assert [record["values"] for record in executed] == sent
    assert [record["event"] for record in executed] == events


async def test_an_axis_that_is_not_there_is_refused_before_it_is_sent(stack: Stack) -> None:
    async with Console(stack.operator, video=False, audio=False) as console:
        await console.take_seat()
        for values in ({"base.up": 1.0}, {"base.vx": float("nan")}, [1.0]):
            with pytest.raises(CommandError):
                await console.drive(values)


async def test_an_observer_sees_but_cannot_drive(stack: Stack) -> None:
    async with (
        Console(stack.observer) as observer,
        Console(stack.operator, video=False, audio=False) as operator,
    ):
        with pytest.raises(SeatRefused, match="not_allowed"):
            await observer.take_seat()
        with pytest.raises(CommandRefused, match="no_seat"):
            await observer.drive([0.1, 0.0, 0.0])
        await operator.take_seat()
        async with collecting(observer, sound=False) as found, asyncio.timeout(20):
            for _ in range(10):
                driven = await drive_on(operator, [0.0, 0.0, 0.2])
            async for feedback in observer.feedbacks():
                if feedback.event >= driven.event:
                    break
        assert all(found.values())


async def test_the_seat_is_one_and_passes_on_when_it_is_given_back(stack: Stack) -> None:
    async with (
        Console(stack.operator, video=False, audio=False, name="first") as first,
        Console(stack.operator, video=False, audio=False, name="second") as second,
    ):
        await first.take_seat()
        assert first.seat.holder == first.peer
        with pytest.raises(SeatRefused, match="seat_taken"):
            await second.take_seat()
        with pytest.raises(CommandRefused, match="no_seat"):
            await second.drive([0.1, 0.0, 0.0])
        first.release_seat()
        async with asyncio.timeout(20):
            async for _ in second.feedbacks():
                if not second.seat.holder:
                    break
        await second.take_seat()
        assert (await drive_on(second, [0.0, 0.0, 0.0])).event > 0


async def test_a_stop_from_an_observer_latches_until_an_operator_resets(stack: Stack) -> None:
    async with (
        Console(stack.operator, video=False, audio=False) as operator,
        Console(stack.observer, video=False, audio=False, name="visitor") as observer,
    ):
        await operator.take_seat()
        await drive_on(operator, [0.1, 0.0, 0.0])
        state = await observer.stop("a person came in")
        assert (state.stopped, state.reason) == (True, "a person came in")
        with pytest.raises(CommandRefused, match="stopped"):
            await operator.drive([0.1, 0.0, 0.0])
        with pytest.raises(CommandRefused, match="not_allowed"):
            await observer.reset()
        stopped = operator.feedback
        assert not (await operator.reset(state.number)).stopped
        assert stopped is not None
        with pytest.raises(NotArmed):
            await operator.drive([0.0, 0.0, 0.0])
        feedback = await operator.arm()
        assert feedback.at_rest
        executed = await stack.events("executed")
        armed = [each["values"] for each in executed if stopped.event < each["event"] <= feedback.event]
        assert armed
        assert all(values == [0.0, 0.0, 0.0] for values in armed)
        assert (await drive_on(operator, [0.1, 0.0, 0.0])).event > feedback.event


async def test_a_script_that_says_nothing_sends_neutral_and_then_rests(stack: Stack) -> None:
    async with Console(stack.operator, video=False, audio=False) as console:
        await console.take_seat()
        driven = await drive_on(console, [0.2, 0.0, 0.0])
        assert console.stats().armed
        async with asyncio.timeout(20):
            async for feedback in console.feedbacks():
                if feedback.event >= driven.event + 3:
                    break
        await console.rest()
        assert console.feedback is not None
        assert console.feedback.at_rest
        assert not console.stats().armed
        newest = console.feedback.event
    await until_logged(stack, "executed", lambda record: record["event"] == newest)
    idle = [record["values"] for record in await stack.events("executed") if driven.event < record["event"] <= newest]
    assert len(idle) >= 3
    assert all(values == [0.0, 0.0, 0.0] for values in idle)


async def test_leaving_brings_the_robot_to_rest_and_frees_the_seat(stack: Stack) -> None:
    async with Console(stack.operator, video=False, audio=False) as console:
        await console.take_seat()
        driven = await drive_on(console, [0.3, 0.0, 0.0])
    await until_logged(stack, "rest", lambda record: record["event"] >= driven.event)
    await until_logged(stack, "feedback", lambda record: record["event"] >= driven.event and record["at_rest"])
    async with Console(stack.operator, video=False, audio=False) as console:
        await console.take_seat()


async def test_counting_receives_every_frame_and_decodes_none(stack: Stack) -> None:
    async with Console(stack.observer, decode=False) as console:
        async with asyncio.timeout(20):
            async for _ in console.feedbacks():
                if all(stream.frames >= 10 for stream in console.stats().streams):
                    break
        streams = console.stats().streams
        assert {stream.kind for stream in streams} == {"video", "audio"}
        assert all((stream.lost, stream.unstamped, stream.rendered) == (0, 0, 0) for stream in streams)
        assert all(stream.stamp >= 1 for stream in streams)
        with pytest.raises(NoSuchStream):
            await anext(console.pictures())


async def test_paced_by_media_every_event_is_seen(stack: Stack) -> None:
    async with Console(stack.operator, pacing="media", tolerance=0, audio=False) as console:
        await console.take_seat()
        events = [(await drive_on(console, [0.0, 0.0, 0.3])).event for _ in range(12)]
        # As the gate let it pass: a reader that a busy machine holds up is not given a picture that is too old by then.
        seen = {rendering.stamp for rendering in console.rendered(console.description.cameras[0].name)}
        assert set(events[:-1]) <= seen
        assert console.stats().streams[0].max_gap == 0
        assert console.stats().picture_delay_p50_ms is not None


async def test_a_wrong_token_is_refused_with_advice(stack: Stack) -> None:
    with pytest.raises(SignallingRefused, match="use a link of this console"):
        async with Console(f"{stack.console}/#token=wrong"):
            pass


async def test_pacing_by_media_needs_pictures(stack: Stack) -> None:
    with pytest.raises(ValueError, match="needs decoded pictures"):
        Console(stack.operator, pacing="media", decode=False)


async def test_a_console_that_was_left_is_lost(stack: Stack) -> None:
    async with Console(stack.operator, video=False, audio=False) as console:
        pass
    with pytest.raises(ConsoleLost):
        await console.drive([0.0, 0.0, 0.0])
    with pytest.raises(ConsoleLost):
        await Console(stack.operator).rest()
    assert await executed_after(stack, 0.0)


async def test_a_client_that_asks_is_told_where_the_time_of_its_pictures_and_commands_goes(stack: Stack) -> None:
    async with Console(stack.operator, codec="H264", audio=False) as console:
        await console.take_seat()
        for _ in range(20):
            await drive_on(console, {"base.wz": 0.3})
        assert console.traces() == Traces()
        console.trace()
        traces = Traces()
        while not (traces.pictures and traces.commands):
            await drive_on(console, {"base.wz": 0.3})
            traces = console.traces()
        console.trace(wanted=False)
        cameras = {camera.name for camera in console.description.cameras}
    assert {each.stream for each in traces.pictures} <= cameras
    for picture in traces.pictures:
        told = known_spans(picture.spans).keys()
        assert {"capture_ms", "link_wait_ms", "encoder_wait_ms", "encode_ms", "packetise_ms", "send_ms"} <= told
    for command in traces.commands:
        told = known_spans(command.spans).keys()
        assert {"forward_ms", "link_ms", "tick_wait_ms", "apply_ms", "measure_ms", "back_ms"} == told - {"rate_wait_ms"}
