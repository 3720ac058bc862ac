"""Who may ask for an action, and what everyone is told of it."""

import asyncio
import json
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from types import SimpleNamespace
from typing import Any, cast

import msgspec
import pytest

from lockstep.protocol.actions import Act, ActionCancel, ActionReason, ActionState, ActionUpdate
from lockstep.protocol.console import decode_client_message
from lockstep.protocol.description import Action, RobotDescription
from lockstep.protocol.errors import MessageError
from lockstep.server.actions import action_requests, action_service
from lockstep.server.actions.action_service import ActionService
from lockstep.server.actions.action_states import KEPT
from lockstep.server.audit.records import Actor
from lockstep.server.errors import (
    ActionIdUsed,
    ConsoleError,
    NotFound,
    NotRenewable,
    RobotLinkDown,
    TooManyRequests,
    Unconfirmed,
)
from lockstep.server.event_clock import EventClock
from lockstep.server.peers.peer import Peer
from lockstep.server.session_events import (
    ActionAsked,
    ActionCancelled,
    ActionRefused,
    ActionUpdated,
    InputRefused,
    SessionEvents,
)
from lockstep.server.telemetry.metrics import Metrics
from tests.makers import feedback
from tests.waiting import eventually

ADA = Actor("Ada", "operator", "p1", "link-1")
DESCRIPTION = RobotDescription(
    name="r",
    label="R",
    axes=(),
    actions=(Action(name="home", label="Home"), Action(name="light", label="Light", moves=False)),
)


class Robot:
    def __init__(self) -> None:
        self.up = True
        self.detail = "away"
        self.description: RobotDescription | None = DESCRIPTION
        self.sent: list[Act | ActionCancel] = []

    def send(self, message: Act | ActionCancel) -> bool:
        self.sent.append(message)
        return self.up


class Bench:
    def __init__(self) -> None:
        self.robot = Robot()
        self.clock = EventClock()
        self.clock.begin("e")
        self.clock.observe(feedback(7, nonce=77), 0.0)
        self.holder = "p1"
        self.told: list[Any] = []
        self.published: list[msgspec.Struct] = []
        events = SessionEvents(Metrics(process=False).faults)
        for kind in (ActionAsked, ActionCancelled, ActionRefused, ActionUpdated, InputRefused):
            events.subscribe(kind, self.published.append)
        self.proven = True  # the holder has sent its neutral command
        self.service = ActionService(
            self.robot, self.clock, self.holds_seat, lambda peer: self.proven and self.holds_seat(peer), events
        )

    def holds_seat(self, peer: Peer) -> bool:
        return peer.id == self.holder

    def peer(self, id: str = "p1", role: str = "operator") -> Peer:
        actor = ADA._replace(peer=id, role=role, link=id)
        made = SimpleNamespace(id=id, role=role, name="Ada", actor=actor, identity=SimpleNamespace(token_id=id))
        made.send = lambda channel, message: self.told.append(message)
        return cast(Peer, made)

    def kinds(self) -> list[str]:
        return [type(each).__name__ for each in self.published]


def act(id: str = "a", name: str = "home") -> Act:
    return Act(id=id, name=name, nonce=77, by="somebody else")


def update(
    id: str = "a",
    state: ActionState = "running",
    *,
    moves: bool = True,
    reason: ActionReason = "",
    progress: float = 0.0,
) -> ActionUpdate:
    return ActionUpdate(id=id, name="home", state=state, moves=moves, event=7, reason=reason, progress=progress)


def test_a_newcomer_is_told_how_long_ago_an_action_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    bench, now = Bench(), [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    old = msgspec.structs.replace(update("old", "cancelled", reason="driving"), age=40.0)  # from before this console
    for each in (old, update("a"), update("b")):
        bench.service.updated(each)
    now[0] = 110.0
    bench.service.updated(update("a", "done"))
    now[0] = 115.0
    bench.service.updated(msgspec.structs.replace(old, age=55.0))  # a link that came back says it again
    assert [(each.id, each.age) for each in bench.service.newest()] == [("old", 55.0), ("a", 5.0), ("b", 0.0)]
    told = [each.update for each in bench.published if isinstance(each, ActionUpdated)]
    assert [(each.id, each.age) for each in told] == [("old", 40.0), ("a", 0.0), ("b", 0.0), ("a", 0.0)]


def test_the_holders_request_goes_to_the_robot_under_the_holders_name() -> None:
    bench = Bench()
    bench.service.act_by_peer(bench.peer(), act())
    assert bench.robot.sent == [msgspec.structs.replace(act(), by="Ada")]
    assert bench.told == []
    assert bench.kinds() == ["ActionAsked"]


@pytest.mark.parametrize(
    ("id", "role", "up", "reason"),
    [
        ("p2", "observer", True, "not_allowed"),
        ("p2", "operator", True, "no_seat"),
        ("p2", "supervisor", True, "no_seat"),
        ("p1", "operator", False, "link_down"),
    ],
)
def test_others_and_without_a_link_are_refused_by_name(id: str, role: str, up: bool, reason: str) -> None:
    bench = Bench()
    bench.robot.up = up
    bench.service.act_by_peer(bench.peer(id, role), act())
    assert [(each.state, each.reason) for each in bench.told] == [("refused", reason)]
    assert bench.robot.sent == []
    assert bench.service.newest() == [], "others are not told"
    assert bench.kinds() == ["ActionRefused"]


def test_a_name_that_somebody_made_up_goes_no_farther() -> None:
    bench = Bench()
    bench.service.act_by_peer(bench.peer(), act(name="\u202ehome"))
    assert [each.reason for each in bench.told] == ["unknown_action"]
    assert bench.robot.sent == []


def test_a_new_holder_moves_nothing_before_its_own_neutral_command() -> None:
    bench = Bench()
    bench.proven = False
    bench.service.act_by_peer(bench.peer(), act())
    assert [(each.state, each.reason) for each in bench.told] == [("refused", "not_neutral")]
    assert bench.robot.sent == []
    bench.service.act_by_peer(bench.peer(), act("b", "light"))
    bench.proven = True
    bench.service.act_by_peer(bench.peer(), act("c"))
    assert [each.id for each in bench.robot.sent] == ["b", "c"]


@pytest.mark.parametrize("id", ["", "x" * 65, "a b", "a\n", "\u202e"])
def test_an_id_is_letters_and_digits(id: str) -> None:
    with pytest.raises(MessageError):
        decode_client_message(json.dumps({"type": "act", "id": id, "name": "home"}))


def test_a_flood_of_requests_is_refused() -> None:
    bench = Bench()
    for number in range(30):
        bench.service.act_by_peer(bench.peer(), act(f"n{number}"))
    assert len(bench.robot.sent) < 15
    assert {each.reason for each in bench.told} == {"too_often"}


def test_the_holder_and_supervisors_cancel_and_nobody_else() -> None:
    bench = Bench()
    bench.service.updated(update())
    bench.service.cancel_by_peer(bench.peer("p2"), ActionCancel(id="a"))
    bench.service.cancel_by_peer(bench.peer("p3", "observer"), ActionCancel(id="a"))
    assert bench.robot.sent == []
    bench.service.cancel_by_peer(bench.peer("p4", "supervisor"), ActionCancel(id="a"))
    bench.service.cancel_by_peer(bench.peer(), ActionCancel())
    assert bench.robot.sent == [ActionCancel(id="a"), ActionCancel()]


def test_a_seat_that_changes_hands_cancels_only_what_moves() -> None:
    bench = Bench()
    bench.service.updated(update("light", moves=False))
    bench.service.cancel("", Actor())
    assert bench.robot.sent == []
    bench.service.updated(update("a"))
    bench.service.cancel("", Actor())
    assert bench.robot.sent == [ActionCancel()]


def test_what_moves_is_known_to_have_ended_when_the_link_is_lost() -> None:
    bench = Bench()
    bench.service.updated(update("a"))
    bench.service.updated(update("light", moves=False))
    bench.service.robot_link_down()
    assert [(each.id, each.state, each.reason) for each in bench.service.newest()] == [
        ("a", "cancelled", "link_down"),
        ("light", "running", ""),
    ]
    bench.service.epoch_ends()
    assert bench.service.newest() == []
    bench.service.updated(update("a"))
    assert bench.service.newest()[0].age == 0.0, "an id of the bridge before has no time any more"


def test_a_flood_of_progress_is_thinned_and_every_end_is_told() -> None:
    bench = Bench()
    for number in range(1000):
        bench.service.updated(update(progress=number / 1000))
    bench.service.updated(update(state="done", progress=1.0))
    told = [each for each in bench.published if isinstance(each, ActionUpdated)]
    assert len(told) < 200
    assert told[-1].update.state == "done"
    for number in range(100):
        bench.service.updated(update(f"n{number}", "done"))
    assert len(bench.service.newest()) == 32


def test_only_an_action_that_runs_and_moves_is_renewed() -> None:
    bench = Bench()
    bench.service.updated(update("light", moves=False))
    bench.service.updated(update("over", "done"))
    bench.service.updated(update("a"))
    assert [id for id in ("", "made-up", "light", "over", "a") if bench.service.renews(id)] == ["a"]


def told(bench: Bench) -> list[ActionUpdate]:
    return [each.update for each in bench.published if isinstance(each, ActionUpdated)]


async def test_a_flood_of_new_states_is_thinned_counted_and_the_newest_of_each_action_is_told() -> None:
    bench = Bench()
    for number in range(20_000):
        bench.service.updated(update(f"a{number % 2}", "running" if number // 2 % 2 else "done"))
    assert len(told(bench)) < 300
    refused = [each for each in bench.published if isinstance(each, InputRefused)]
    assert {(each.channel, each.error) for each in refused} == {("robot", "too_many_action_states")}
    assert len(refused) + len(told(bench)) == 20_000
    bench.service.updated(update("a0", "failed"))
    bench.service.updated(update("a1", "cancelled"))
    running = asyncio.ensure_future(bench.service.run())
    await eventually(lambda: {each.state for each in told(bench)[-2:]} == {"failed", "cancelled"})
    running.cancel()
    await asyncio.wait([running])
    assert [each.state for each in bench.service.newest()] == ["failed", "cancelled"]


async def test_a_flood_of_actions_that_nobody_asked_for_does_not_hide_the_end_of_one_that_somebody_did() -> None:
    bench = Bench()
    bench.service.act_by_peer(bench.peer(), act("asked"))
    for number in range(1000):
        bench.service.updated(update(f"n{number}", "done"))
    bench.service.updated(update("asked"))
    for number in range(1000):
        bench.service.updated(update(f"m{number}", "done"))
    bench.service.updated(update("asked", "done"))
    assert len(bench.service.newest()) == 32
    running = asyncio.ensure_future(bench.service.run())
    await eventually(lambda: (told(bench)[-1].id, told(bench)[-1].state) == ("asked", "done"))
    assert told(bench)[-1].age > 0, "it is told late, and says so"
    running.cancel()
    await asyncio.wait([running])


async def by_http(bench: Bench, name: str = "light", id: str = "", nonce: int | None = None) -> ActionUpdate:
    return await bench.service.act_by_http(ADA, name, {"on": True}, id, nonce)


async def test_over_http_a_repeated_id_begins_nothing_again_and_gets_the_same_answer() -> None:
    bench = Bench()
    first, again = (asyncio.create_task(by_http(bench, id="mine", nonce=70)) for _ in range(2))
    await asyncio.sleep(0)
    (sent,) = bench.robot.sent
    assert isinstance(sent, Act)
    assert (sent.id, sent.nonce) == ("mine", 70)
    bench.service.updated(update("mine", moves=False))
    assert ((await first).state, (await again).state) == ("running", "running")
    bench.service.updated(update("mine", "done", moves=False))
    bench.robot.up = False
    assert (await by_http(bench, id="mine")).state == "done"
    assert len(bench.robot.sent) == 1


async def test_over_http_a_repeated_id_gets_the_newest_of_its_action_even_when_newcomers_are_not_told_of_it() -> None:
    bench = Bench()
    asking = asyncio.create_task(by_http(bench, id="mine"))
    await asyncio.sleep(0)
    bench.service.updated(update("mine", moves=False))
    assert (await asking).state == "running"
    bench.service.updated(update("mine", "done", moves=False))
    for number in range(KEPT):
        bench.service.updated(update(f"n{number}", "done"))
    assert "mine" not in {each.id for each in bench.service.newest()}
    assert (await by_http(bench, id="mine")).state == "done"


async def test_over_http_an_id_from_before_a_restart_of_the_bridge_is_unknown_and_whoever_waits_is_told() -> None:
    bench = Bench()
    asking = asyncio.create_task(by_http(bench, id="mine"))
    await asyncio.sleep(0)
    bench.service.updated(update("mine", "done", moves=False))
    await asking
    waiting = asyncio.create_task(by_http(bench, id="open"))
    await asyncio.sleep(0)
    bench.service.epoch_ends()
    with pytest.raises(Unconfirmed, match="ended before it answered"):
        await waiting
    again = asyncio.create_task(by_http(bench, id="mine"))
    await asyncio.sleep(0)
    assert [each.id for each in bench.robot.sent if isinstance(each, Act)] == ["mine", "open", "mine"]
    bench.service.updated(update("mine", "running", moves=False))
    assert (await again).state == "running", "the answer of the new bridge"


async def test_over_http_repeats_of_an_id_spend_the_budget_too() -> None:
    bench = Bench()
    asking = asyncio.create_task(by_http(bench, id="mine"))
    await asyncio.sleep(0)
    bench.service.updated(update("mine", "done", moves=False))
    await asking
    repeats = (by_http(bench, id="mine") for _ in range(action_service.ASKS + 20))
    answers = await asyncio.gather(*repeats, return_exceptions=True)
    assert TooManyRequests in {type(each) for each in answers}


async def test_over_http_an_id_of_another_request_is_refused() -> None:
    bench = Bench()
    bench.service.act_by_peer(bench.peer(), act("theirs", "light"))
    asking = asyncio.create_task(by_http(bench, id="mine"))
    await asyncio.sleep(0)
    bench.service.updated(update("mine", "done", moves=False))
    await asking
    for id, name in (("theirs", "light"), ("mine", "home")):
        with pytest.raises(ActionIdUsed):
            await by_http(bench, name, id)
    assert len(bench.robot.sent) == 2


async def test_over_http_a_request_that_did_not_leave_may_be_repeated() -> None:
    bench = Bench()
    bench.robot.up = False
    with pytest.raises(RobotLinkDown):
        await by_http(bench, id="mine")
    bench.robot.up = True
    asking = asyncio.create_task(by_http(bench, id="mine"))
    await asyncio.sleep(0)
    bench.service.updated(update("mine", "done", moves=False))
    assert (await asking).state == "done"


async def test_over_http_the_robots_first_answer_is_returned() -> None:
    bench = Bench()
    asking = asyncio.create_task(by_http(bench))
    await asyncio.sleep(0)
    (sent,) = bench.robot.sent
    assert isinstance(sent, Act)
    assert (sent.nonce, sent.by, sent.parameters) == (77, "Ada", {"on": True})
    bench.service.updated(update(sent.id, "done", moves=False))
    assert (await asking).state == "done"


@pytest.mark.parametrize(
    ("name", "up", "error"),
    [
        ("home", True, NotRenewable),
        ("fly", True, NotFound),
        ("light", False, RobotLinkDown),
        ("light", True, Unconfirmed),
    ],
)
async def test_over_http_what_cannot_be_done_is_refused_by_name(
    name: str, up: bool, error: type[ConsoleError], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(action_requests, "ANSWER_SECONDS", 0.01)
    bench = Bench()
    bench.robot.up = up
    with pytest.raises(error):
        await by_http(bench, name)


async def test_over_http_a_flood_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(action_requests, "ANSWER_SECONDS", 0.0)
    bench = Bench()
    raised = []
    for _ in range(15):
        try:
            await by_http(bench)
        except ConsoleError as error:
            raised.append(type(error))
    assert TooManyRequests in raised


async def test_over_http_a_cancel_is_answered_with_the_end_of_the_action() -> None:
    bench = Bench()
    bench.service.updated(update())
    waiting = [asyncio.create_task(bench.service.cancel_by_http(ADA, "a")) for _ in range(2)]
    await asyncio.sleep(0)
    assert bench.robot.sent == [ActionCancel(id="a")] * 2
    bench.service.updated(update(progress=0.5))
    assert not any(each.done() for each in waiting)
    bench.service.updated(update("b", "done"))
    bench.service.updated(update("a", "cancelled", reason="cancelled"))
    assert [(await each).reason for each in waiting] == ["cancelled"] * 2
    assert [each.by for each in bench.published if isinstance(each, ActionCancelled)] == [ADA, ADA]


async def test_over_http_a_cancel_after_the_end_tells_how_it_ended_and_reaches_no_robot() -> None:
    bench = Bench()
    bench.service.updated(update("a", "done"))
    assert (await bench.service.cancel_by_http(ADA, "a")).state == "done"
    assert (bench.robot.sent, "ActionCancelled" in bench.kinds()) == ([], False)


async def test_over_http_a_cancel_long_after_the_end_tells_it_with_its_age_and_reaches_no_robot(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bench, now = Bench(), [100.0]
    monkeypatch.setattr(action_service, "time", SimpleNamespace(monotonic=lambda: now[0]))
    asking = asyncio.create_task(by_http(bench, id="mine"))
    await asyncio.sleep(0)
    bench.service.updated(update("mine", moves=False))
    await asking
    now[0] = 110.0
    bench.service.updated(msgspec.structs.replace(update("mine", "done", moves=False), age=3.0))
    now[0] = 115.0
    for number in range(2 * KEPT):
        bench.service.updated(update(f"n{number}", "done"))
    assert "mine" not in {each.id for each in bench.service.newest()}
    bench.robot.sent.clear()
    bench.robot.up = False
    ended = await bench.service.cancel_by_http(ADA, "mine")
    assert (ended.state, ended.age) == ("done", 8.0)
    assert await by_http(bench, id="mine") == ended, "a repeat of the request is told the same"
    assert (bench.robot.sent, "ActionCancelled" in bench.kinds()) == ([], False)


async def test_over_http_an_action_whose_first_news_is_on_the_way_is_cancelled() -> None:
    bench = Bench()
    asking = asyncio.create_task(by_http(bench, id="mine"))
    await asyncio.sleep(0)
    cancelling = asyncio.create_task(bench.service.cancel_by_http(ADA, "mine"))
    await asyncio.sleep(0)
    assert bench.robot.sent[-1] == ActionCancel(id="mine")
    bench.service.updated(update("mine", moves=False))
    bench.service.updated(update("mine", "cancelled", moves=False))
    assert ((await asking).state, (await cancelling).state) == ("running", "cancelled")


@pytest.mark.parametrize(("id", "up", "error"), [("b", True, NotFound), ("a", False, RobotLinkDown)])
async def test_over_http_a_cancel_that_reaches_no_action_is_refused_by_name(
    id: str, up: bool, error: type[ConsoleError]
) -> None:
    bench = Bench()
    bench.service.updated(update())
    bench.robot.up = up
    with pytest.raises(error):
        await bench.service.cancel_by_http(ADA, id)
    assert bench.robot.sent == []


async def test_over_http_a_cancel_whose_end_does_not_come_is_unconfirmed(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench()
    bench.service.updated(update())
    waiting = asyncio.create_task(bench.service.cancel_by_http(ADA, "a"))
    await asyncio.sleep(0)
    bench.service.epoch_ends()
    with pytest.raises(Unconfirmed, match="bridge ended"):
        await waiting
    monkeypatch.setattr(action_requests, "ANSWER_SECONDS", 0.01)
    bench.service.updated(update())
    with pytest.raises(Unconfirmed):
        await bench.service.cancel_by_http(ADA, "a")


async def test_over_http_a_link_that_has_asked_too_often_still_cancels_but_no_flood(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(action_requests, "ANSWER_SECONDS", 0.0)
    bench = Bench()
    bench.service.updated(update("a", "done"))

    async def many(ask: Callable[[], Awaitable[ActionUpdate]]) -> None:
        for _ in range(action_service.ASKS + 20):
            with suppress(Unconfirmed):
                await ask()

    with pytest.raises(TooManyRequests):
        await many(lambda: by_http(bench))
    assert (await bench.service.cancel_by_http(ADA, "a")).state == "done"
    with pytest.raises(TooManyRequests):
        await many(lambda: bench.service.cancel_by_http(ADA, "a"))
