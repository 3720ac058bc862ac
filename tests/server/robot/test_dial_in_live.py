"""Robots that dial their console: a real console with TLS, real bridges, real TCP."""

import asyncio
import logging
import ssl
import time
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import pytest
from starlette.websockets import WebSocket

from lockstep.bench.harness.tcp_path import TcpPath
from lockstep.protocol.console import Role, SeatRequest
from lockstep.protocol.dial_in import PairingCode, RobotToken
from lockstep.protocol.errors import LinkRefused
from lockstep.protocol.link_secret import LinkSecret
from lockstep.robot_bridge.dial.console_connection import console_context, open_connection
from lockstep.robot_bridge.dial.console_key import ConsoleKey
from lockstep.robot_bridge.dial.pairing import pair
from lockstep.robot_bridge.errors import ConsoleRefused, PairingRefused, WrongConsole
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.server.http.transport.tls import own_pin
from lockstep.server.robot.pairing_offer import MAX_TRIES
from lockstep.server.robot.waiting_robots import WaitingRobot
from tests.robot_bridge.bridge_helpers import DRIVE, NEUTRAL, RecordingRobot
from tests.server.rig import PATIENCE, Rig, eventually, running_rig
from tests.server.robot.dial_in_rig import (
    address_of,
    code_for,
    dial_in_of,
    dialling_bridge,
    made_certificate,
    paired_key,
    until_up,
    waiting_console,
)
from tests.support.connect_proxy import ConnectProxy, pump


async def kinds(rig: Rig) -> list[str]:
    page = (await rig.http.get("/api/audit", headers=rig.token("supervisor"))).json()
    return [each["what"] for each in page["records"] if each["kind"] == "pairing"]


def wrong(code: PairingCode) -> PairingCode:
    return PairingCode(code.place, "2" * 10 if code.secret != "2" * 10 else "3" * 10)


async def test_a_robot_that_was_paired_by_a_code_is_driven_as_any_other(tmp_path: Path) -> None:
    async with waiting_console(tmp_path) as rig:
        key = await paired_key(rig)
        assert key.pin.startswith("sha256:")
        robot = RecordingRobot(media=True)
        async with dialling_bridge(address_of(rig), key, robot):
            await until_up(rig)
            async with rig.peer("operator") as peer:
                await peer.feedback()
                peer.send("session", SeatRequest())
                await peer.drive(NEUTRAL)
                before = (await peer.drive(NEUTRAL)).event
                assert (await peer.drive(DRIVE)).event > before
                await robot.until(lambda: robot.applied[-1][1][0] > 0, "the robot moves")
        assert await kinds(rig) == ["code", "paired"]


async def test_a_path_that_breaks_leaves_the_robot_at_rest_and_it_comes_back_by_itself(tmp_path: Path) -> None:
    async with waiting_console(tmp_path) as rig, TcpPath(("127.0.0.1", address_of_port(rig))) as path:
        key = await paired_key(rig, path.port)
        robot = RecordingRobot()
        async with dialling_bridge(address_of(rig, path.port), key, robot) as bridge:
            for _ in range(3):
                await until_up(rig)
                async with rig.peer("operator") as peer:
                    await peer.feedback()
                    peer.send("session", SeatRequest())
                    await peer.drive(NEUTRAL)
                    await peer.drive(DRIVE)
                    await robot.until(lambda: robot.applied[-1][1][0] > 0, "the robot moves")
                    path.away = True
                    path.cut()
                    await robot.until(lambda: robot.applied[-1][1] == NEUTRAL, "the robot rests")
                    event = bridge.event
                    await until_up(rig, up=False)
                    path.away = False
                    await until_up(rig)
                    assert bridge.event == event  # nothing late executed


def address_of_port(rig: Rig) -> int:
    return int(rig.url.rpartition(":")[2])


async def test_a_robot_without_a_key_is_refused_by_name_and_gets_no_websocket(tmp_path: Path) -> None:
    async with waiting_console(tmp_path) as rig:
        for header in ({}, {"Authorization": "Bearer x"}, {"Authorization": RobotToken.of(LinkSecret.draw()).header}):
            with pytest.raises(ConsoleRefused, match="robot_unknown") as refused:
                await open_connection(address_of(rig).path("operator"), console_context("any", None), headers=header)
            assert refused.value.status == 401
        assert rig.count("lockstep_bad_input_total", where="dial", reason="robot_unknown") == 3
        assert not rig.dependencies.console.robot.up


@pytest.mark.parametrize("path", ["operator", "media", "pair"])
async def test_a_page_of_any_site_is_refused_and_uses_up_and_lists_nothing(tmp_path: Path, path: str) -> None:
    """A browser says where the page is from; no robot does."""
    async with waiting_console(tmp_path) as rig:
        await code_for(rig)
        for origin in ("https://evil.example", rig.url, "null"):
            with pytest.raises(ConsoleRefused, match="origin_refused") as refused:
                await open_connection(
                    address_of(rig).path(path), console_context("any", None), headers={"Origin": origin}
                )
            assert refused.value.status == 403
        assert await waits(rig) == []


async def test_many_refusals_of_one_address_are_answered_too_many_requests_and_fill_no_log(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
) -> None:
    async with waiting_console(tmp_path, max_refused_burst=3) as rig:
        statuses = []
        for _ in range(5):
            with pytest.raises(ConsoleRefused) as refused:
                await open_connection(address_of(rig).path("media"), console_context("any", None))
            statuses.append(refused.value.status)
        assert statuses == [401, 401, 401, 429, 429]
    said = capfd.readouterr()
    assert "handshake" not in caplog.text + said.out + said.err


async def test_a_wrong_code_is_refused_and_after_a_few_the_right_one_too(tmp_path: Path) -> None:
    async with waiting_console(tmp_path) as rig:
        code = await code_for(rig)
        for _ in range(MAX_TRIES):
            with pytest.raises(PairingRefused, match="wrong_code"):
                await pair(address_of(rig), wrong(code), "planar", None)
        with pytest.raises(ConsoleRefused, match="not_pairing: too_many_tries"):
            await pair(address_of(rig), code, "planar", None)
        assert dial_in_of(rig).key is None
        assert "refused: wrong_code" in await kinds(rig)


async def test_a_code_works_once(tmp_path: Path) -> None:
    async with waiting_console(tmp_path) as rig:
        code = await code_for(rig)
        await pair(address_of(rig), code, "planar", None)
        with pytest.raises(ConsoleRefused, match="not_pairing: code_used"):
            await pair(address_of(rig), code, "planar", None)


async def test_without_an_open_code_nobody_pairs(tmp_path: Path) -> None:
    async with waiting_console(tmp_path) as rig:
        with pytest.raises(ConsoleRefused, match="not_pairing"):
            await pair(address_of(rig), PairingCode.draw(), "planar", None)


async def test_another_console_with_another_key_gets_neither_the_robot_nor_its_token(tmp_path: Path) -> None:
    async with waiting_console(tmp_path / "own") as own, waiting_console(tmp_path / "other") as other:
        key = await paired_key(own)
        with pytest.raises(WrongConsole, match="another console"):
            await open_connection(
                address_of(other).path("operator"),
                console_context(key.pin, None),
                expected=key.pin,
                headers={"Authorization": RobotToken.of(key.key).header},
            )
        assert other.count("lockstep_bad_input_total", where="dial", reason="robot_unknown") == 0


async def test_a_console_that_knows_the_token_and_not_the_key_does_not_get_the_robot(tmp_path: Path) -> None:
    """Whoever took the token on its way has only that."""
    async with waiting_console(tmp_path) as rig:
        key = await paired_key(rig)
        robot = RecordingRobot()
        liar = LinkSecret.draw()
        async with dialling_bridge(address_of(rig), ConsoleKey(liar, key.pin), robot) as bridge:
            dial_in_of(rig).knows = lambda authorization: True  # type: ignore[method-assign]
            await eventually(lambda: bridge.counters.bad_input["unauthorised"] > 0)
            assert not rig.dependencies.console.robot.up


async def test_somebody_between_with_another_certificate_cannot_pair(tmp_path: Path) -> None:
    (tmp_path / "between").mkdir()
    async with waiting_console(tmp_path / "own") as rig, Between(tmp_path / "between", rig) as port:
        code = await code_for(rig)
        with pytest.raises(PairingRefused, match="wrong_certificate"):
            await pair(address_of(rig, port), code, "planar", None)
        assert dial_in_of(rig).key is None


class Between:
    """Ends TLS with a certificate of its own, and hands everything on."""

    def __init__(self, directory: Path, rig: Rig) -> None:
        self._certificate, self._rig = made_certificate(directory), rig
        self._ends: set[asyncio.StreamWriter] = set()

    async def __aenter__(self) -> int:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(self._certificate.chain, self._certificate.key)
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", 0, ssl=context)
        return int(self._server.sockets[0].getsockname()[1])

    async def __aexit__(self, *_: object) -> None:
        self._server.close()
        for end in self._ends:
            end.transport.abort()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._ends.add(writer)
        there, back = await asyncio.open_connection(
            "127.0.0.1", address_of_port(self._rig), ssl=console_context("any", None)
        )
        self._ends.add(back)
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(pump(reader, back))
            tasks.create_task(pump(there, writer))


async def test_a_robot_that_is_forgotten_rests_is_out_at_once_and_does_not_come_back(tmp_path: Path) -> None:
    async with waiting_console(tmp_path) as rig:
        key = await paired_key(rig)
        robot = RecordingRobot()
        async with dialling_bridge(address_of(rig), key, robot) as bridge:
            await until_up(rig)
            async with rig.peer("operator") as peer:
                await peer.feedback()
                peer.send("session", SeatRequest())
                await peer.drive(NEUTRAL)
                await peer.drive(DRIVE)
                answer = await rig.http.delete("/api/dial-in/robot", headers=rig.token("supervisor"))
                assert answer.json()["state"] in ("unpaired", "connected")
                await robot.until(lambda: robot.applied[-1][1] == NEUTRAL, "the robot rests")
                await until_up(rig, up=False)
            await eventually(lambda: bridge.links == 0)
            with pytest.raises(ConsoleRefused, match="robot_unknown"):
                await open_connection(
                    address_of(rig).path("operator"),
                    console_context(key.pin, None),
                    headers={"Authorization": RobotToken.of(key.key).header},
                )
        assert (await kinds(rig))[-1] == "forgotten"


async def test_a_robot_that_is_forgotten_while_its_websocket_opens_gets_no_link(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opens = WebSocket.accept
    async with waiting_console(tmp_path) as rig:
        key = await paired_key(rig)
        dial_in = dial_in_of(rig)

        async def forgotten_then(websocket: WebSocket, **options: Any) -> None:
            await opens(websocket, **options)
            await dial_in.forget()

        monkeypatch.setattr(WebSocket, "accept", forgotten_then)
        arrived: list[str] = []
        monkeypatch.setattr(dial_in, "arrived", lambda role, line: arrived.append(role))
        connection = await open_connection(
            address_of(rig).path("operator"),
            console_context(key.pin, None),
            headers={"Authorization": RobotToken.of(key.key).header},
        )
        async with asyncio.timeout(PATIENCE):
            await connection.wait_closed()
        assert arrived == []
        assert rig.count("lockstep_bad_input_total", where="dial", reason="robot_unknown") == 1


async def test_a_second_robot_with_the_key_says_that_it_waits_and_then_that_it_has_the_place(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lockstep.robot_bridge.dial.dialer.OWN_LINK_ENDS", 0.1)
    caplog.set_level(logging.INFO, "lockstep.robot_bridge.dial.dialer")

    def said(words: str) -> int:
        return sum(words in record.getMessage() for record in caplog.records)

    async with waiting_console(tmp_path) as rig, AsyncExitStack() as first:
        key = await paired_key(rig)
        await first.enter_async_context(dialling_bridge(address_of(rig), key))
        await until_up(rig)
        await eventually(lambda: said("link has reached the console at") == 2)
        async with dialling_bridge(address_of(rig), key):
            await eventually(lambda: said("the console has another connection with this robot's key") == 2)
            assert said("link has reached the console at") == 2
            await asyncio.sleep(2.5)  # a bridge gives up a connection without hello after 2 s, and dials again
            assert said("the console has another connection with this robot's key") == 2
            await first.aclose()
            await eventually(lambda: said("link has reached the console at") == 4)
            assert said("the console has another connection with this robot's key") == 2
            await until_up(rig)


async def test_a_second_console_is_refused_while_the_first_holds_the_robot(tmp_path: Path) -> None:
    async with waiting_console(tmp_path) as rig:
        key = await paired_key(rig)
        async with dialling_bridge(address_of(rig), key, listen=True) as bridge:
            await until_up(rig)
            with pytest.raises(LinkRefused, match="taken"):
                await RobotLink(*bridge.address, "operator", name="another console").connect()


async def test_a_console_that_ends_in_order_leaves_the_robot_free_for_another(tmp_path: Path) -> None:
    async with AsyncExitStack() as console:
        rig = await console.enter_async_context(waiting_console(tmp_path))
        key = await paired_key(rig)
        async with dialling_bridge(address_of(rig), key, listen=True) as bridge:
            await until_up(rig)
            await console.aclose()
            assert bridge.counters.endings["closing"] >= 1
            async with RobotLink(*bridge.address, "operator", name="another console") as link:
                assert link.connected


async def test_a_paired_robot_is_known_after_a_restart_of_the_console(tmp_path: Path) -> None:
    async with waiting_console(tmp_path, state_dir=tmp_path / "state") as rig:
        key = await paired_key(rig)
    async with waiting_console(tmp_path, state_dir=tmp_path / "state") as rig, dialling_bridge(address_of(rig), key):
        await until_up(rig)
        info = (await rig.http.get("/api/dial-in", headers=rig.token("supervisor"))).json()
        assert (info["state"], info["robot"], info["by"]) == ("connected", "planar", "supervisor")
        assert info["address"] == "127.0.0.1"


async def test_only_a_supervisor_pairs_forgets_and_sees_addresses(tmp_path: Path) -> None:
    async with waiting_console(tmp_path) as rig:
        for role in ("operator", "observer"):
            assert (await rig.http.post("/api/dial-in/code", headers=rig.token(role))).status_code == 403
            assert (await rig.http.delete("/api/dial-in/code", headers=rig.token(role))).status_code == 403
            assert (await rig.http.delete("/api/dial-in/robot", headers=rig.token(role))).status_code == 403
            info = (await rig.http.get("/api/dial-in", headers=rig.token(role))).json()
            assert (info["may_pair"], info["state"], info["address"]) == (False, "unpaired", "")


async def waits(rig: Rig, role: Role = "supervisor") -> list[tuple[str, str, str]]:
    info = (await rig.http.get("/api/dial-in", headers=rig.token(role))).json()
    assert all(abs(each["since"] - time.time()) < PATIENCE for each in info["waits"])
    return [(each["address"], each["name"], each["why"]) for each in info["waits"]]


def waits_of(rig: Rig) -> list[WaitingRobot]:
    return dial_in_of(rig).waits.waiting(time.monotonic())


async def test_a_supervisor_alone_is_told_of_robots_that_wait_until_one_is_let_in(tmp_path: Path) -> None:
    async with waiting_console(tmp_path) as rig:
        assert await waits(rig) == []
        with pytest.raises(ConsoleRefused, match="not_pairing"):
            await pair(address_of(rig), PairingCode.draw(), "planar", None)
        assert await waits(rig) == [("127.0.0.1", "", "not_pairing")]
        with pytest.raises(ConsoleRefused, match="robot_unknown"):
            await open_connection(address_of(rig).path("operator"), console_context("any", None))
        assert await waits(rig) == [("127.0.0.1", "", "robot_unknown")]
        code = await code_for(rig)
        with pytest.raises(PairingRefused, match="wrong_code"):
            await pair(address_of(rig), wrong(code), "pla\n\x1b[2Jnar\u202e", None)
        assert await waits(rig) == [("127.0.0.1", "pla [2Jnar", "wrong_code")]
        assert (await rig.http.delete("/api/dial-in/code", headers=rig.token("supervisor"))).status_code == 200
        with pytest.raises(ConsoleRefused, match="not_pairing"):
            await pair(address_of(rig), code, "planar", None)
        assert await waits(rig) == [("127.0.0.1", "pla [2Jnar", "not_pairing")]
        code = await code_for(rig)
        for role in ("operator", "observer"):
            assert await waits(rig, role) == []
        key = await pair(address_of(rig), code, "planar", None)
        async with dialling_bridge(address_of(rig), key):
            await until_up(rig)
            assert await waits(rig) == []


async def test_refusals_beyond_an_addresss_rate_are_answered_without_being_noted(tmp_path: Path) -> None:
    async with waiting_console(tmp_path, max_refused_burst=1) as rig:
        noted: list[str] = []
        dial_in_of(rig).refused = lambda address, why, name="": noted.append(why)  # type: ignore[method-assign]
        for status in (401, 429, 429):
            with pytest.raises(ConsoleRefused) as refused:
                await open_connection(address_of(rig).path("operator"), console_context("any", None))
            assert refused.value.status == status
        assert noted == ["robot_unknown"]


async def test_tries_to_pair_beyond_an_addresss_rate_are_answered_without_being_noted(tmp_path: Path) -> None:
    async with waiting_console(tmp_path, max_refused_burst=1) as rig:
        noted: list[str] = []
        dial_in_of(rig).refused = lambda address, why, name="": noted.append(why)  # type: ignore[method-assign]
        for status in (409, 429, 429):
            with pytest.raises(ConsoleRefused) as refused:
                await pair(address_of(rig), PairingCode.draw(), "planar", None)
            assert refused.value.status == status
        assert noted == ["not_pairing"]


async def test_a_second_robot_with_the_key_is_one_that_waits_and_the_first_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lockstep.server.robot.second_connection.OWN_LINK_ENDS", 0.1)
    async with waiting_console(tmp_path) as rig, AsyncExitStack() as first:
        key = await paired_key(rig)
        await first.enter_async_context(dialling_bridge(address_of(rig), key))
        await until_up(rig)
        assert await waits(rig) == []
        async with dialling_bridge(address_of(rig), key):
            await eventually(lambda: waits_of(rig))
            assert await waits(rig) == [("127.0.0.1", "", "taken")], "it has not said its name"
            await first.aclose()
            await eventually(lambda: not waits_of(rig))
            await until_up(rig)


async def test_a_paired_robot_has_to_be_forgotten_before_another_is_paired(tmp_path: Path) -> None:
    async with waiting_console(tmp_path) as rig:
        await paired_key(rig)
        answer = await rig.http.post("/api/dial-in/code", headers=rig.token("supervisor"))
        assert (answer.status_code, answer.json()["error"]) == (409, "already_paired")


async def test_a_key_file_needs_no_pairing(tmp_path: Path) -> None:
    (tmp_path / "key").write_text("k" * 40)
    async with waiting_console(tmp_path, link_secret_file=tmp_path / "key") as rig:
        key = ConsoleKey(LinkSecret("k" * 40), await _pin(rig))
        async with dialling_bridge(address_of(rig), key):
            await until_up(rig)
        answer = await rig.http.post("/api/dial-in/code", headers=rig.token("supervisor"))
        assert (answer.status_code, answer.json()["error"]) == (409, "not_dial_in")


async def _pin(rig: Rig) -> str:
    pin = own_pin(rig.dependencies.settings, Path())
    assert pin is not None
    return pin


async def test_a_console_that_connects_itself_says_that_no_robot_dials_in() -> None:
    async with running_rig() as rig:
        info = (await rig.http.get("/api/dial-in", headers=rig.token("observer"))).json()
        assert info["dials_in"] is False
        answer = await rig.http.post("/api/dial-in/code", headers=rig.token("supervisor"))
        assert (answer.status_code, answer.json()["error"]) == (409, "not_dial_in")


async def test_a_robot_dials_through_an_http_proxy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async with waiting_console(tmp_path) as rig, ConnectProxy() as proxy:
        monkeypatch.setenv("https_proxy", proxy.url)
        monkeypatch.setenv("no_proxy", "")
        key = await paired_key(rig)
        async with dialling_bridge(address_of(rig), key):
            await until_up(rig)
            assert len(proxy.asked) >= 3
            assert set(proxy.asked) == {f"127.0.0.1:{address_of_port(rig)}"}


async def test_a_robot_that_pairs_slowly_or_sends_garbage_costs_a_place_for_seconds_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lockstep.server.routes.dial_in.PAIRING_SECONDS", 0.2)
    async with waiting_console(tmp_path) as rig:
        await code_for(rig)
        for first in (None, b"", b"\xc1", b"x" * 4000, "text"):
            connection = await open_connection(address_of(rig).path("pair"), console_context("any", None))
            if first is not None:
                await connection.send(first)
            async with asyncio.timeout(PATIENCE):
                await connection.wait_closed()
        await eventually(lambda: dial_in_of(rig).exchanges == 0)
        assert rig.count("lockstep_bad_input_total", where="dial", reason="malformed") == 3
        assert rig.count("lockstep_bad_input_total", where="dial", reason="too_large") == 1
        assert rig.count("lockstep_bad_input_total", where="dial", reason="too_slow") == 1
        assert rig.count("lockstep_internal_errors_total", where="dial") == 0
