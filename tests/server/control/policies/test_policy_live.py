"""Policies over real data channels: what they may do, and how a person takes the robot from them."""

import secrets

import pytest

from lockstep.protocol.actions import Act, ActionUpdate
from lockstep.protocol.console import (
    Rename,
    Seat,
    SeatOffer,
    SeatRelease,
    SeatRequest,
    SeatTake,
    ServerMessage,
    Shadow,
    ShadowVerdict,
    StopStateNotice,
    Welcome,
)
from lockstep.protocol.episodes import EpisodeAnswer, EpisodeRequest
from lockstep.protocol.messages import Command, Feedback, Ping, Refusal, Reset, Stop
from lockstep.protocol.serial import event_after
from tests.server.rig import Rig, TestPeer, eventually, running_rig

PATIENT = {"seat_timeout": 60.0}  # test peers have no heartbeat


async def _id(peer: TestPeer) -> str:
    welcome = await peer.until(lambda each: isinstance(each, Welcome))
    assert isinstance(welcome, Welcome)
    return welcome.peer


async def _seat(peer: TestPeer, **state: object) -> Seat:
    """The newest seat message, as soon as it says so."""

    def found(each: ServerMessage) -> bool:
        newest = next((seat for seat in reversed(peer.heard) if isinstance(seat, Seat)), None)
        return each is newest and all(getattr(each, name) == value for name, value in state.items())

    message = await peer.until(found)
    assert isinstance(message, Seat)
    return message


async def _refused(peer: TestPeer, reason: str) -> Refusal:
    message = await peer.until(lambda each: isinstance(each, Refusal) and each.reason == reason)
    assert isinstance(message, Refusal)
    return message


async def _policy_drives(rig: Rig, person: TestPeer, policy: TestPeer) -> None:
    """Offer the seat to the policy, which takes it and moves the robot."""
    person.send("session", SeatOffer())
    await _seat(policy, offered=True)
    policy.send("session", SeatRequest(only_if_free=True))
    await _seat(policy, holder=await _id(policy), kind="policy")
    await policy.feedback()
    await policy.drive([0.0, 0.0, 0.0])
    await policy.drive([0.2, 0.0, 0.0])
    assert rig.dependencies.console.seat.state.policy_drives


async def test_a_policy_drives_in_a_seat_that_a_person_offers_and_loses_it_to_one_press() -> None:
    async with running_rig(**PATIENT) as rig, rig.peer("operator") as person, rig.peer("policy") as policy:
        policy.send("session", SeatRequest(only_if_free=True))
        assert "offers" in (await _refused(policy, "not_allowed")).detail
        person.send("session", SeatRequest())
        await _seat(policy, kind="human")
        await _policy_drives(rig, person, policy)
        rests = rig.count("lockstep_rests_total", why="taken")
        person.send("session", SeatTake())
        await _seat(policy, holder=await _id(person), why="taken", kind="human", offered=False)
        assert rig.count("lockstep_rests_total", why="taken") == rests + 1
        now = policy.newest_feedback()
        moving = Command(event=event_after(now.event), issue=now.issue, nonce=now.nonce, values=[0.2, 0.0, 0.0])
        policy.send("control", moving)
        await _refused(policy, "no_seat")
        now = person.newest_feedback()
        person.send(
            "control", Command(event=event_after(now.event), issue=now.issue, nonce=now.nonce, values=[0.2, 0, 0])
        )
        await _refused(person, "not_neutral")
        await person.drive([0.0, 0.0, 0.0])
        await person.drive([0.1, 0.0, 0.0])


@pytest.mark.parametrize("press", [SeatTake(), SeatRequest()])
async def test_no_bound_on_requests_keeps_a_person_from_taking_the_robot_from_a_policy(
    press: SeatTake | SeatRequest,
) -> None:
    async with running_rig(**PATIENT) as rig, rig.peer("operator") as person, rig.peer("policy") as policy:
        await _policy_drives(rig, person, policy)
        for number in range(30):
            person.send("session", Rename(name=f"Ada {number}"))
        await _refused(person, "too_often")
        person.send("session", press)
        await _seat(policy, holder=await _id(person), why="taken")


async def test_no_bound_on_requests_keeps_a_person_from_ending_the_turn_of_a_policy() -> None:
    async with running_rig(**PATIENT) as rig, rig.peer("operator") as person, rig.peer("policy") as policy:
        await _policy_drives(rig, person, policy)
        for number in range(30):
            person.send("session", Rename(name=f"Ada {number}"))
        await _refused(person, "too_often")
        person.send("session", SeatOffer(offered=False))
        await _seat(policy, holder="", why="offer withdrawn", offered=False)


async def test_a_page_that_only_looks_for_a_free_seat_does_not_take_it_from_a_policy() -> None:
    async with (
        running_rig(**PATIENT) as rig,
        rig.peer("operator") as person,
        rig.peer("policy") as policy,
        rig.peer("operator") as another,
    ):
        await _policy_drives(rig, person, policy)
        another.send("session", SeatRequest(only_if_free=True))
        await _refused(another, "seat_taken")
        assert rig.dependencies.console.seat.state.policy_drives


async def test_a_policy_may_stop_the_robot_which_ends_its_turn_and_may_not_reset_it() -> None:
    async with running_rig(**PATIENT) as rig, rig.peer("operator") as person, rig.peer("policy") as policy:
        await _policy_drives(rig, person, policy)
        policy.send("stop", Stop(reason="the block has slipped"))
        await _seat(person, holder="", why="stopped", offered=False)
        policy.send("stop", Reset(number=1))
        assert "policies" in (await _refused(policy, "not_allowed")).detail
        policy.send("session", SeatRequest(only_if_free=True))
        await policy.until(lambda each: isinstance(each, Refusal) and "offers" in each.detail)
        await person.until(lambda each: isinstance(each, StopStateNotice) and each.stop.stopped)


async def test_a_stop_by_anybody_ends_the_offer_before_a_policy_has_taken_the_seat() -> None:
    async with (
        running_rig(**PATIENT) as rig,
        rig.peer("operator") as person,
        rig.peer("observer") as watcher,
        rig.peer("policy") as policy,
    ):
        person.send("session", SeatOffer())
        await _seat(policy, offered=True)
        watcher.send("stop", Stop(reason="wait"))
        await _seat(policy, offered=False)
        policy.send("session", SeatRequest(only_if_free=True))
        await _refused(policy, "not_allowed")


async def test_no_policy_is_let_drive_while_the_robot_is_stopped() -> None:
    async with running_rig(**PATIENT) as rig, rig.peer("operator") as person, rig.peer("policy") as policy:
        person.send("stop", Stop(reason="wait"))
        await policy.until(lambda each: isinstance(each, Feedback) and each.stop.stopped)
        person.send("session", SeatOffer())
        await _refused(person, "stopped")
        policy.send("session", SeatRequest(only_if_free=True))
        await _refused(policy, "not_allowed")
        assert rig.dependencies.console.seat.state.offer is None


async def test_what_a_policy_may_not_do() -> None:
    async with running_rig(**PATIENT) as rig, rig.peer("operator") as person, rig.peer("policy") as policy:
        await _policy_drives(rig, person, policy)
        policy.send("session", Act(id=secrets.token_hex(8), name="home"))
        answer = await policy.until(lambda each: isinstance(each, ActionUpdate))
        assert isinstance(answer, ActionUpdate)
        assert (answer.state, answer.reason) == ("refused", "not_allowed")
        policy.send("session", EpisodeRequest(id="1", do="start", task="anything"))
        said = await policy.until(lambda each: isinstance(each, EpisodeAnswer))
        assert isinstance(said, EpisodeAnswer)
        assert said.reason == "not_allowed"
        for message in (SeatOffer(), SeatOffer(offered=False), SeatTake()):
            policy.heard.clear()
            policy.send("session", message)
            await _refused(policy, "not_allowed")
        assert rig.dependencies.console.seat.state.policy_drives
        headers = rig.token("policy")
        for path, body in (
            ("/api/actions/home", {}),
            ("/api/reset", {"number": 1}),
            ("/api/recordings", {}),
            ("/api/episode/start", {"task": "x"}),
            ("/api/invitations", {"role": "policy", "seconds": 600}),
        ):
            assert (await rig.http.post(path, headers=headers, json=body)).status_code == 403, path


async def test_a_policy_is_known_by_its_link_whatever_it_calls_itself() -> None:
    async with running_rig(**PATIENT) as rig, rig.peer("operator") as person, rig.peer("policy") as policy:
        policy.send("session", Rename(name="operator"))
        await _policy_drives(rig, person, policy)
        assert (await _seat(person, kind="policy")).name.startswith("operator")


async def test_the_turn_of_a_policy_ends_when_the_person_who_let_it_drive_has_gone() -> None:
    async with running_rig(**PATIENT) as rig, rig.peer("operator") as another, rig.peer("policy") as policy:
        async with rig.peer("operator") as person:
            await _policy_drives(rig, person, policy)
        await eventually(lambda: rig.dependencies.console.seat.state.holder == "")
        await _seat(another, holder="", why="nobody attends", offered=False)


async def test_the_turn_of_a_policy_ends_when_that_person_is_silent() -> None:
    async with running_rig(seat_timeout=1.0) as rig, rig.peer("operator") as person, rig.peer("policy") as policy:
        person.send("session", SeatOffer())
        await _seat(policy, offered=True)
        policy.send("session", SeatRequest(only_if_free=True))
        await _seat(policy, holder=await _id(policy))
        seen = await policy.feedback()
        while rig.dependencies.console.seat.state.policy_drives:  # its own heartbeat does not stand in for the person's
            policy.send("control", Ping(id=seen.issue))
            before = seen
            seen = await policy.feedback(lambda each, before=before: each.issue > before.issue)  # type: ignore[misc]
        await _seat(person, holder="", why="nobody attends")


async def test_an_offer_frees_the_holders_seat_and_names_the_policy_that_may_have_it() -> None:
    async with (
        running_rig(**PATIENT) as rig,
        rig.peer("operator") as person,
        rig.peer("policy") as one,
        rig.peer("policy") as other,
    ):
        person.send("session", SeatRequest())
        await _seat(person, holder=await _id(person))
        person.send("session", SeatOffer(peer=await _id(person)))
        assert (await _refused(person, "not_allowed")).detail == "this is no policy"
        person.send("session", SeatOffer(peer=await _id(other)))
        await _seat(person, holder="", why="offered", offered_to=await _id(other), offered_by="operator")
        one.send("session", SeatRequest(only_if_free=True))
        await _refused(one, "not_allowed")
        other.send("session", SeatRequest(only_if_free=True))
        await _seat(person, holder=await _id(other), kind="policy")
        other.send("session", SeatRelease())
        await _seat(person, holder="", offered=False)


async def test_a_shadow_is_judged_and_shown_and_never_reaches_the_robot() -> None:
    async with running_rig(**PATIENT) as rig, rig.peer("operator") as person, rig.peer("policy") as policy:
        person.send("session", SeatRequest())
        await _seat(person, holder=await _id(person))
        await person.feedback()
        await person.drive([0.0, 0.0, 0.0])
        now = await policy.feedback(lambda each: each.event == person.newest_feedback().event)
        event = event_after(now.event)
        policy.send("control", Shadow(event=event, issue=now.issue, nonce=now.nonce, values=[0.3, 0.0, 0.0]))
        policy.send("control", Command(event=event, issue=now.issue, nonce=now.nonce, values=[0.3, 0.0, 0.0]))
        await _refused(policy, "no_seat")  # sent after the shadow, which has come too
        assert rig.dependencies.console.clock.event == now.event
        executed = await person.drive([0.2, 0.0, 0.0])
        assert executed.event == event
        for peer in (person, policy):
            verdict = await peer.until(lambda each: isinstance(each, ShadowVerdict))
            assert isinstance(verdict, ShadowVerdict)
            assert (verdict.peer, verdict.event, verdict.judgement) == (await _id(policy), event, "in_time")
            assert verdict.values == [0.3, 0.0, 0.0]
            assert verdict.difference is not None


async def test_only_a_policy_is_a_shadow() -> None:
    async with running_rig(**PATIENT) as rig, rig.peer("operator") as person, rig.peer("observer") as watcher:
        for peer in (person, watcher):
            now = await peer.feedback()
            assert isinstance(now, Feedback)
            peer.send("control", Shadow(event=event_after(now.event), issue=now.issue, nonce=now.nonce, values=[0.0]))
            assert (await _refused(peer, "not_allowed")).detail == "shadow"


async def test_a_flood_of_shadows_ends_the_policy_that_sends_it_and_disturbs_nobody() -> None:
    async with running_rig(**PATIENT) as rig, rig.peer("operator") as person, rig.peer("policy") as policy:
        person.send("session", SeatRequest())
        await _seat(person, holder=await _id(person))
        await person.feedback()
        await person.drive([0.0, 0.0, 0.0])
        now = await policy.feedback()
        for number in range(1500):
            policy.send("control", Shadow(event=now.event + 1 + number % 3, issue=1, values=[0.1] * 64))
        policy.send_raw("control", '{"type": "shadow", "event": 2, "issue": 1, "values": [NaN]}')
        policy.send_raw("control", '{"type": "shadow", "event": 2, "issue": 1, "values": [1e999]}')
        for value in (0.1, 0.2, 0.3):
            await person.drive([value, 0.0, 0.0])
        await eventually(lambda: all(peer.role != "policy" for peer in rig.dependencies.console.peers))


async def test_a_policy_that_is_slow_is_late_like_anybody_and_one_that_has_not_seen_is_refused() -> None:
    async with running_rig(**PATIENT) as rig, rig.peer("operator") as person, rig.peer("policy") as policy:
        await _policy_drives(rig, person, policy)
        thought = policy.newest_feedback()
        now = thought
        while now.time - thought.time <= rig.dependencies.console.robot.description.max_event_age:  # type: ignore[union-attr]
            before = now
            now = await policy.feedback(lambda each, before=before: each.time > before.time)  # type: ignore[misc]
        event = event_after(now.event)
        policy.send("control", Command(event=event, issue=thought.issue, nonce=thought.nonce, values=[0.2, 0.0, 0.0]))
        assert (await _refused(policy, "late")).event == event
        policy.send("control", Command(event=event, issue=now.issue, nonce=now.nonce + 1, values=[0.2, 0.0, 0.0]))
        assert (await _refused(policy, "unseen")).event == event
        assert rig.dependencies.console.clock.event == now.event


async def test_over_http_a_person_takes_over_and_gives_back() -> None:
    async with running_rig(**PATIENT) as rig, rig.peer("operator") as person, rig.peer("policy") as policy:
        await _policy_drives(rig, person, policy)
        for stranger in (rig.token("observer"), policy.headers):
            for path, body in (("take_over", {}), ("offer", {}), ("offer", {"offered": False})):
                answer = await rig.http.post(f"/api/seat/{path}", headers=stranger, json=body)
                assert (answer.status_code, answer.json()["error"]) == (403, "not_allowed")
        assert rig.dependencies.console.seat.state.policy_drives
        taken = (await rig.http.post("/api/seat/take_over", headers=person.headers)).json()
        assert (taken["holder"], taken["why"], taken["kind"]) == (await _id(person), "taken", "human")
        absent = rig.token("operator")
        answer = await rig.http.post("/api/seat/offer", headers=absent, json={})
        assert (answer.status_code, answer.json()["error"]) == (403, "not_allowed")
        given = (
            await rig.http.post("/api/seat/offer", headers=person.headers, json={"peer": await _id(policy)})
        ).json()
        assert (given["holder"], given["offered"], given["offered_to"]) == ("", True, await _id(policy))
        policy.heard.clear()
        policy.send("session", SeatRequest(only_if_free=True))
        await _seat(policy, kind="policy")
        # a person who is not connected rests the robot all the same; the seat is free then
        taken = (await rig.http.post("/api/seat/take_over", headers=absent)).json()
        assert (taken["holder"], taken["why"], taken["offered"]) == ("", "offer withdrawn", False)


async def test_a_moving_action_ends_before_a_policy_drives_and_none_runs_while_it_does() -> None:
    async with running_rig(**PATIENT) as rig, rig.peer("operator") as person, rig.peer("policy") as policy:
        person.send("session", SeatRequest())
        await _seat(person, holder=await _id(person))
        await person.feedback()
        await person.drive([0.0, 0.0, 0.0])
        for _ in range(3):
            await person.drive([0.3, 0.0, 0.0])
        begun, number = False, 0
        while not begun:  # a busy machine may hold the robot up: then a neutral command comes first again
            number += 1
            await person.drive([0.0, 0.0, 0.0])
            person.send("session", Act(id=f"h{number}", name="home", nonce=person.newest_feedback().nonce))
            said = await person.until(
                lambda each, id=f"h{number}": isinstance(each, ActionUpdate) and each.id == id  # type: ignore[misc]
            )
            begun = isinstance(said, ActionUpdate) and said.state != "refused"
        person.send("session", SeatOffer())
        await person.until(lambda each: isinstance(each, ActionUpdate) and each.state in ("cancelled", "done"))
        policy.send("session", SeatRequest(only_if_free=True))
        await _seat(policy, holder=await _id(policy))
        person.send("session", Act(id="i", name="home", nonce=person.newest_feedback().nonce))
        refused = await person.until(lambda each: isinstance(each, ActionUpdate) and each.id == "i")
        assert isinstance(refused, ActionUpdate)
        assert (refused.state, refused.reason) == ("refused", "no_seat")
