"""Who is told of a relay, and what a page may connect to."""

import pytest

from lockstep.server.sfu.coordinator import WAIT_SECONDS
from tests.server.rig import eventually, running_rig

NOWHERE = "janus:ws://127.0.0.1:9/4711"  # nobody listens on the discard port


async def test_without_relays_everyone_is_served_by_the_console() -> None:
    async with running_rig() as rig:
        answer = await rig.http.get("/api/relay", headers=rig.token("observer"))
    assert answer.json() == {"relay": None}


async def test_operators_and_supervisors_are_never_sent_to_a_relay_and_wait_for_none() -> None:
    async with running_rig(relay=NOWHERE, observers_direct=0) as rig:
        for role in ("operator", "supervisor"):
            answer = await rig.http.get("/api/relay", headers=rig.token(role))
            assert answer.json() == {"relay": None}
        assert not rig.dependencies.relays._wanted.is_set()


async def test_an_observer_is_served_directly_when_no_relay_can_be_reached() -> None:
    async with running_rig(relay=NOWHERE, observers_direct=0) as rig:
        answer = await rig.http.get("/api/relay", headers=rig.token("observer"), timeout=WAIT_SECONDS + 10)
        assert answer.json() == {"relay": None}
        station = next(iter(rig.dependencies.relays.servers))
        assert station.trouble.startswith("unreachable")


async def test_the_relay_is_asked_for_only_when_the_console_serves_enough_itself() -> None:
    async with running_rig(relay=NOWHERE, observers_direct=5) as rig:
        answer = await rig.http.get("/api/relay", headers=rig.token("observer"))
        assert answer.json() == {"relay": None}
        assert not rig.dependencies.relays._wanted.is_set()


async def test_without_a_token_nobody_is_told_of_a_relay() -> None:
    async with running_rig(relay=NOWHERE) as rig:
        assert (await rig.http.get("/api/relay")).status_code == 401


async def test_the_page_may_connect_to_its_relays_and_nowhere_else() -> None:
    async with running_rig(relay=NOWHERE) as rig:
        policy = (await rig.http.get("/")).headers["content-security-policy"]
    assert "connect-src 'self' ws://127.0.0.1:9;" in policy


async def test_an_observer_behind_a_relay_gets_no_feedback_from_the_console(monkeypatch: pytest.MonkeyPatch) -> None:
    async with running_rig(relay=NOWHERE) as rig, rig.peer("observer") as peer:
        known = next(iter(rig.dependencies.console.peers))
        assert known in rig.dependencies.console.peers.observers()
        known.relay = "0"
        assert known not in rig.dependencies.console.peers.observers()
        passed_on: list[str] = []
        monkeypatch.setattr(rig.dependencies.relays, "send_feedback", passed_on.append)
        await eventually(lambda: bool(passed_on))
        await peer.feedback()
