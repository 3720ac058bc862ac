"""Actions that move the robot, asked for over real data channels of a real console with a real bridge."""

import pytest

from lockstep.protocol.actions import Act, ActionUpdate, Parameters
from lockstep.protocol.console import Role, SeatRequest, SeatTake
from lockstep.protocol.messages import Command
from lockstep.protocol.serial import event_after
from tests.robot_bridge.bridge_helpers import DRIVE, NEUTRAL
from tests.server.rig import TestPeer, eventually, running_rig


async def _answer(peer: TestPeer, id: str) -> ActionUpdate:
    """The first update of the action of this id."""
    message = await peer.until(lambda each: isinstance(each, ActionUpdate) and each.id == id)
    assert isinstance(message, ActionUpdate)
    return message


async def test_a_new_holder_that_has_sent_no_neutral_command_begins_no_motion() -> None:
    async with running_rig() as rig, rig.peer("operator") as before, rig.peer("supervisor") as holder:
        await before.feedback()
        await holder.feedback()
        before.send("session", SeatRequest())
        await before.drive(NEUTRAL)
        driven = await before.drive(DRIVE)
        holder.send("session", SeatTake())
        await holder.feedback(lambda each: each.event == driven.event)
        await eventually(lambda: rig.dependencies.console.seat.state.why == "taken")
        await eventually(lambda: holder.newest_feedback().at_rest)
        holder.send("session", Act(id="early", name="home", nonce=holder.newest_feedback().nonce))
        refused = await _answer(holder, "early")
        assert (refused.state, refused.reason) == ("refused", "not_neutral")
        await holder.drive(NEUTRAL)
        holder.send("session", Act(id="proper", name="home", nonce=holder.newest_feedback().nonce))
        assert (await _answer(holder, "proper")).state in ("running", "done")


async def test_a_neutral_command_that_names_no_running_action_does_not_keep_the_seat(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with running_rig() as rig, rig.peer("operator") as peer:
        moved: list[str] = []
        monkeypatch.setattr(rig.dependencies.console.seat, "moved", lambda peer: moved.append(peer.id))
        await peer.feedback()
        peer.send("session", SeatRequest())
        await peer.drive(NEUTRAL)
        now = peer.newest_feedback()
        event = event_after(now.event)
        peer.send("control", Command(event=event, issue=now.issue, nonce=now.nonce, values=NEUTRAL, action="made-up"))
        await peer.feedback(lambda each: each.event == event)
        assert moved == []


async def test_over_http_a_repeated_request_with_an_id_and_an_old_nonce_begins_nothing_again() -> None:
    async with running_rig() as rig, rig.peer("operator") as peer:
        await peer.feedback()
        peer.send("session", SeatRequest())
        await peer.drive(NEUTRAL)
        body = {"id": "a1", "nonce": peer.newest_feedback().nonce}
        answers = [await rig.http.post("/api/actions/light", headers=peer.headers, json=body) for _ in range(2)]
        assert [each.json()["id"] for each in answers] == ["a1", "a1"]
        stale = await rig.http.post("/api/actions/light", headers=peer.headers, json={"id": "a2", "nonce": 1})
        assert (stale.json()["state"], stale.json()["reason"]) == ("refused", "late")
        other = await rig.http.post("/api/actions/home", headers=peer.headers, json=body)
        assert (other.status_code, other.json()["error"]) == (409, "action_id_used")
        bad = await rig.http.post("/api/actions/light", headers=peer.headers, json={"id": "a b"})
        assert bad.status_code == 400


async def test_over_http_the_holder_or_a_supervisor_cancels_and_the_audit_says_who() -> None:
    far: Parameters = {"x": 1.0, "y": 0.5, "yaw": 0.0}
    async with running_rig() as rig, rig.peer("operator") as peer:
        await peer.feedback()
        peer.send("session", SeatRequest())
        for role in ("operator", "supervisor"):
            await peer.drive(NEUTRAL)
            peer.send("session", Act(id=role, name="go_to", parameters=far, nonce=peer.newest_feedback().nonce))
            assert (await _answer(peer, role)).state == "running"
            headers = peer.headers if role == "operator" else rig.token("supervisor")
            ended = await rig.http.delete(f"/api/actions/{role}", headers=headers)
            assert (ended.status_code, ended.json()["state"], ended.json()["reason"]) == (200, "cancelled", "cancelled")
            again = await rig.http.delete(f"/api/actions/{role}", headers=headers)
            assert again.json() | {"age": 0.0} == ended.json() | {"age": 0.0}
        rig.dependencies.console.audit.flush(beyond=True)
        records = (await rig.http.get("/api/audit", headers=rig.token("supervisor"))).json()["records"]
        cancelled = [each for each in records if (each["kind"], each.get("what")) == ("action", "cancel")]
        assert [(each["role"], each.get("peer", "")) for each in cancelled] == [("operator", ""), ("supervisor", "")]


@pytest.mark.parametrize(
    ("role", "status", "name"),
    [
        ("observer", 403, "not_allowed"),
        ("policy", 403, "not_allowed"),
        ("operator", 403, "no_seat"),
        ("supervisor", 404, "not_found"),
    ],
)
async def test_over_http_nobody_else_cancels(role: Role, status: int, name: str) -> None:
    async with running_rig() as rig:
        answer = await rig.http.delete("/api/actions/made-up", headers=rig.token(role))
        assert (answer.status_code, answer.json()["error"]) == (status, name)
        assert (await rig.http.delete("/api/actions/made-up")).status_code == 401
