"""The life of a STOP at the console."""

import asyncio
from pathlib import Path
from typing import cast

import pytest
from structlog.testing import capture_logs

from lockstep.protocol.console import Notice
from lockstep.protocol.messages import Stop, StopState, StopTaken
from lockstep.server.audit.records import Actor
from lockstep.server.control.session_audit import STOPS
from lockstep.server.control.stop import stop_service
from lockstep.server.errors import (
    RobotLinkDown,
)
from lockstep.server.stop.stop_presses import Press, new_press
from tests.server.control.stop.stop_bench import StopBench, raised
from tests.server.rig import PATIENCE


async def test_a_stop_is_delivered_only_when_the_robot_has_answered_with_its_number(bench: StopBench) -> None:
    bench.press("olga", "p")
    waiting = asyncio.create_task(bench.service.outcome("p"))
    await asyncio.sleep(0)
    bench.stopped(7)
    await asyncio.sleep(0)
    assert not waiting.done(), "what a feedback shows may be somebody else's stop"
    bench.take("p", 7)
    outcome = await waiting
    assert (outcome.delivered, outcome.number, outcome.press) == (True, 7, "p")
    assert bench.heard("olga", StopTaken) == [StopTaken(press="p", number=7)]
    assert bench.heard("ann", StopTaken) == []
    (record,) = bench.records("stop")
    assert (record.who, record.what, record.detail) == ("olga", "stop, stop 7", "smoke")


def test_a_stop_by_http_has_the_name_of_the_only_person_who_has_its_link(bench: StopBench) -> None:
    """A page sends it by HTTP too, and that may come first."""
    link = bench.peers.all["olga"].identity.token_id
    bench.peers.all["olga"].name = "Olga at the gate"
    bench.service.stop(Press(id="p", by=Actor("observer", "observer", "", link), where="http"))
    assert [message.by for message in bench.robot.sent] == ["Olga at the gate"]
    bench.peers.all["bob"].identity = bench.peers.all["olga"].identity
    bench.service.stop(Press(id="q", by=Actor("observer", "observer", "", link), where="http"))
    assert [message.by for message in bench.robot.sent] == ["Olga at the gate", "observer"], "one of two"


async def test_a_repeat_sends_nothing_and_has_the_outcome_of_its_first_also_when_that_is_not_delivered(
    bench: StopBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stop_service, "CONFIRM_SECONDS", 0.02)
    bench.press("olga", "p")
    bench.press("olga", "p", "http")
    assert len(bench.robot.sent) == 1
    first, again = await asyncio.gather(bench.service.outcome("p"), bench.service.outcome("p"))
    assert not first.delivered
    assert first == again
    bench.take("p", 3)
    bench.press("olga", "p", "control")
    assert (await bench.service.outcome("p")).number == 3
    assert len(bench.heard("olga", StopTaken)) == 2


async def test_a_press_whose_stop_was_reset_goes_to_the_robot_which_says_whether_it_is_a_new_one(
    bench: StopBench,
) -> None:
    bench.press("olga", "p")
    bench.take("p", 3)
    bench.show(StopState(stopped=True, number=3, press="p"))
    bench.press("bob", "p")
    assert len(bench.robot.sent) == 1, "it holds: nothing is sent"
    bench.show(StopState(number=3, press="p"))
    for number, released in ((3, True), (4, False)):
        bench.robot.sent = []
        bench.press("bob", "p", "http")
        assert [cast(Stop, each).press for each in bench.robot.sent] == ["p"]
        bench.take("p", number)
        outcome = await bench.service.outcome("p")
        assert (outcome.number, outcome.released) == (number, released)
    assert [each.what for each in bench.records("stop") if "stop 3" in each.what][-1] == "http, stop 3, reset before"


async def test_with_no_robot_nobody_is_told_that_a_stop_was_delivered_however_many_press(bench: StopBench) -> None:
    bench.lose()
    for who, press in (("ann", "a"), ("bob", "b"), ("bob", "b"), ("olga", "o")):
        bench.press(who, press)
    outcomes = await asyncio.gather(*map(bench.service.outcome, "abo"))
    assert [outcome.delivered for outcome in outcomes] == [False] * 3
    assert all("kept" in outcome.detail for outcome in outcomes)
    assert len([each for each in bench.peers.told if isinstance(each, Notice)]) == 1, "everyone is told once"
    assert {(each.who, each.what) for each in bench.records("stop")} >= {
        (who, "stop, not delivered yet") for who in ("ann", "bob", "olga")
    }
    assert bench.on_disk == 3


async def test_when_the_link_is_back_all_that_has_no_answer_goes_first_in_order(bench: StopBench) -> None:
    bench.press("ann", "a")
    bench.lose()
    bench.press("bob", "b")
    bench.robot.up, bench.robot.sent = True, []
    bench.service.robot_link_up()
    assert [cast(Stop, each).press for each in bench.robot.sent] == ["a", "b"]
    bench.take("a", 1)
    bench.take("b", 2)
    assert bench.heard("ann", StopTaken) == [StopTaken(press="a", number=1)]
    assert [each.what for each in bench.records("stop")][-2:] == [
        "stop, sent again, stop 1",
        "stop, sent again, stop 2",
    ]
    bench.lose()
    bench.robot.up, bench.robot.sent = True, []
    bench.service.robot_link_up()
    assert bench.robot.sent == []


async def test_stop_reset_stop_and_then_no_link_is_a_stop_that_is_sent_again(bench: StopBench) -> None:
    bench.press("ann", "a")
    bench.take("a", 1)
    bench.stopped(1)
    resetting = bench.reset("ann", 1)
    await asyncio.sleep(0)
    bench.press("bob", "b")  # the old latch is still what the feedback shows
    bench.lose()
    assert await raised(resetting) is RobotLinkDown
    bench.robot.up, bench.robot.sent = True, []
    bench.service.robot_link_up()
    assert [cast(Stop, each).press for each in bench.robot.sent] == ["b"]


async def test_while_the_link_for_commands_is_down_a_stop_goes_by_the_one_for_media(bench: StopBench) -> None:
    bench.press("ann", "a")
    bench.robot.media_up, bench.robot.sent = True, []
    bench.lose()
    assert [cast(Stop, each).press for each in bench.robot.sent] == ["a"]
    bench.take("a", 1)
    assert (await bench.service.outcome("a")).delivered


async def test_what_a_link_that_lives_does_not_answer_is_sent_again_by_itself(
    bench: StopBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stop_service, "AGAIN_SECONDS", 0.0)
    monkeypatch.setattr(stop_service, "WATCH_SECONDS", 0.001)
    bench.press("ann", "a")
    async with asyncio.timeout(PATIENCE):
        while len(bench.robot.sent) < 3:  # noqa: ASYNC110
            await asyncio.sleep(0.001)
    assert {cast(Stop, each).press for each in bench.robot.sent} == {"a"}


async def test_after_a_fault_of_ours_a_stop_without_an_answer_is_sent_again_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = StopBench(tmp_path)
    bench.press("ann", "a")
    sends = bench.robot.send_stop

    def fail(stop: Stop) -> bool:
        raise RuntimeError("a fault of ours")

    monkeypatch.setattr(stop_service, "AGAIN_SECONDS", 0.0)
    monkeypatch.setattr(bench.robot, "send_stop", fail)
    with pytest.raises(RuntimeError):
        await bench.service.run()
    monkeypatch.setattr(bench.robot, "send_stop", sends)
    before = len(bench.robot.sent)
    again = asyncio.create_task(bench.service.run())
    async with asyncio.timeout(PATIENCE):
        while len(bench.robot.sent) == before:  # noqa: ASYNC110
            await asyncio.sleep(0)
    again.cancel()


async def test_a_bridge_that_starts_anew_is_told_of_the_stop_that_held(bench: StopBench) -> None:
    bench.press("ann", "a")
    bench.take("a", 1)
    bench.show(StopState(stopped=True, by="ann", reason="smoke", number=1, press="a"))
    bench.robot.sent = []
    bench.service.epoch_ends(bench.clock.stop)
    bench.service.robot_link_up()
    assert bench.robot.sent == [Stop(by="ann", reason="smoke", press="a")]
    assert bench.service.unconfirmed
    bench.take("a", 1)
    bench.service.epoch_ends(StopState(stopped=False, number=1, press="a"))
    assert not bench.service.unconfirmed


async def test_a_bridge_that_starts_anew_is_told_of_a_stop_that_the_last_one_took_and_never_showed(
    bench: StopBench,
) -> None:
    bench.press("ann", "a")
    bench.press("bob", "b")
    bench.take("b", 6, kept=False)
    bench.take("a", 5, kept=False)
    bench.service.epoch_ends(bench.clock.stop)
    assert [press.id for press in bench.keeper.presses.pending] == ["b"]
    bench.take("b", 1)
    bench.show(StopState(stopped=False, number=1))
    bench.service.epoch_ends(bench.clock.stop)
    assert bench.keeper.presses.pending == []


async def test_a_failed_write_is_said_to_whoever_pressed_and_to_everybody(
    bench: StopBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    (bench.directory / "kept-stops").write_text("in the way")
    bench.lose()
    bench.press("ann", "a")
    outcome = await bench.service.outcome("a")
    assert "not on the console's disk" in outcome.detail
    assert any("disk" in each.text for each in bench.peers.told if isinstance(each, Notice))
    assert [each.what for each in bench.records("stop")][-1] == "kept in memory only"
    assert len(list(bench.notices.for_newcomers())) == 1


async def test_a_flood_of_presses_of_one_link_is_few_stops_with_all_answered_and_anothers_goes_at_once(
    bench: StopBench,
) -> None:
    for number in range(200):
        bench.press("olga", str(number))
    bench.press("ann", "a")
    ids = [cast(Stop, each).press for each in bench.robot.sent]
    assert ids == [*map(str, range(stop_service.PRESSES)), "a"]
    async with asyncio.timeout(PATIENCE):
        while len(bench.robot.sent) == len(ids):  # noqa: ASYNC110 - a look, which comes by itself
            await asyncio.sleep(0)
    for number, stop in enumerate(bench.robot.sent):
        bench.take(cast(Stop, stop).press, number + 1)
    assert not bench.service.unconfirmed
    answers = {answer.press: answer.number for answer in bench.heard("olga", StopTaken)}
    assert set(answers) == set(map(str, range(200)))
    assert answers["199"] == stop_service.PRESSES + 2
    assert bench.heard("ann", StopTaken)


async def test_a_press_that_was_answered_uses_up_none_of_what_its_link_may_press(bench: StopBench) -> None:
    bench.press("olga", "a")
    bench.take("a", 1)
    for _ in range(200):
        bench.press("olga", "a")
    assert len(bench.heard("olga", StopTaken)) <= stop_service.PRESSES + 2
    bench.press("olga", "b")
    assert [cast(Stop, each).press for each in bench.robot.sent] == ["a", "b"]


async def test_presses_that_are_held_go_with_all_others_when_the_link_is_back(bench: StopBench) -> None:
    bench.lose()
    for number in range(stop_service.PRESSES + 5):
        bench.press("olga", str(number))
    bench.robot.up = True
    bench.service.robot_link_up()
    assert len(bench.robot.sent) == stop_service.PRESSES + 1
    assert not (await bench.service.outcome(str(stop_service.PRESSES + 4))).delivered
    bench.take(str(stop_service.PRESSES), 9)
    assert (await bench.service.outcome(str(stop_service.PRESSES + 4))).number == 9


async def test_a_flood_of_presses_becomes_few_records(bench: StopBench) -> None:
    for number in range(200):
        bench.press("olga", str(number))
        for stop in bench.robot.sent[-1:]:
            bench.take(cast(Stop, stop).press, number + 1)
    bench.press("ann", "a")
    bench.take("a", 201)
    records = bench.records("stop")
    assert len(records) <= STOPS + 4
    assert sum(record.count for record in records if record.who == "olga") >= 199
    assert [each.what for each in records if each.who == "ann"] == ["stop, stop 201"]


async def test_a_flood_of_presses_becomes_few_lines_of_the_log(bench: StopBench) -> None:
    with capture_logs() as logs:
        for number in range(2 * stop_service.LINES):
            bench.press("olga", str(number))
            bench.take(str(number), number + 1)
        bench.press("sue", "f")
    written = [line["by"] for line in logs if line["event"] == "stop"]
    assert 1 <= written.count("olga") < 2 * stop_service.LINES
    assert written.count("sue") == 1


async def test_a_press_is_told_to_each_sender_by_the_id_that_it_gave(bench: StopBench) -> None:
    press = new_press(bench.peers.all["olga"].actor, "stop", "smoke", "my stop")
    for given in ("my stop", "my stop", "x" * 65):
        bench.service.stop(press, given)
    (sent,) = bench.robot.sent
    assert isinstance(sent, Stop)
    assert sent.press == press.id != "my stop"
    bench.take(press.id, 4)
    assert [each.press for each in bench.heard("olga", StopTaken)] == ["my stop", press.id]
    bench.service.stop(press, "my stop")
    assert bench.heard("olga", StopTaken)[-1] == StopTaken(press="my stop", number=4)
