"""`lockstep check`: what it prints, when it asks, and what it leaves behind."""

import asyncio
import json
import sys
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from lockstep.protocol.link_secret import LinkSecret
from lockstep.protocol.messages import Stop
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.robot_bridge.link.link_tls import LinkTls
from lockstep.robot_bridge.robots.planar import create
from lockstep.robot_bridge.settings import BridgeSettings
from tests.robot_bridge.bridge_helpers import PATIENCE, operator, raw_link
from tests.robot_bridge.conformance.plain_bridge import Fault, running_plain_bridge
from tests.support.certificates import Authority

LOCKSTEP = str(Path(sys.executable).with_name("lockstep"))


@pytest.fixture
async def bridge() -> AsyncIterator[Bridge]:
    async with Bridge(create(), BridgeSettings(port=0)) as running:
        yield running


def url(address: tuple[str, int], scheme: str = "tcp") -> str:
    return f"{scheme}://{address[0]}:{address[1]}"


async def check(*arguments: str) -> tuple[int, str, str]:
    process = await asyncio.create_subprocess_exec(
        *(LOCKSTEP, "check", *arguments),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )
    async with asyncio.timeout(3 * PATIENCE):
        out, err = await process.communicate()
    return process.returncode or 0, out.decode(), err.decode()


async def test_each_case_is_a_line_with_what_the_protocol_asks_and_where(bridge: Bridge) -> None:
    code, out, err = await check(url(bridge.address), "--yes", "--case", "repeat", "--case", "warning")
    assert (code, err) == (0, "")
    first, second, why, summary = out.splitlines()
    assert first.split() == [
        *("ok", "repeat", "a", "repeat", "executes", "nothing", "and", "gets", "the", "stored", "feedback"),
        *("(docs/robot-link.md,", "What", "happens", "to", "a", "command)"),
    ]
    assert second.startswith("not applicable  warning ")
    assert why.strip() == "the description has no start_warning"
    assert summary == "1 ok, 1 not applicable"


async def test_a_failed_case_says_what_was_found_and_the_exit_status_is_1() -> None:
    async with running_plain_bridge(Fault.TWO_OPERATORS) as plain:
        code, out, _ = await check(url(plain.address), "--yes", "--case", "second_operator", "--case", "executes")
    assert code == 1
    assert out.splitlines()[0].startswith("FAILED          second_operator ")
    assert out.splitlines()[1].strip() == "a second operator was admitted beside the first"
    assert out.splitlines()[-1] == "1 ok, 1 failed"


async def test_as_json_it_is_one_object_on_standard_output(bridge: Bridge) -> None:
    code, out, _ = await check(url(bridge.address), "--yes", "--json", "--case", "hold")
    found = json.loads(out)
    assert (code, found["robot"], found["passed"]) == (0, url(bridge.address), True)
    assert [(case["name"], case["result"], case["section"], case["detail"]) for case in found["cases"]] == [
        ("hold", "ok", "Hold", "")
    ]


async def test_without_a_yes_it_says_that_the_robot_moves_and_touches_nothing(bridge: Bridge) -> None:
    code, out, err = await check(url(bridge.address))
    assert (code, out) == (2, "")
    assert "MOVES the robot" in err
    assert "--yes" in err
    assert bridge.counters.endings.total() == 0


async def test_it_leaves_the_robot_at_rest_and_released(bridge: Bridge) -> None:
    code, _, _ = await check(url(bridge.address), "--yes", "--case", "stop_latches", "--case", "moves")
    assert code == 0
    async with operator(bridge, armed=False) as driver:
        assert driver.feedback.stop.number > 0
        assert not driver.feedback.stop.stopped
        assert driver.feedback.at_rest


async def test_a_robot_that_somebody_stopped_is_not_touched(bridge: Bridge) -> None:
    async with raw_link(bridge, "events") as watcher, operator(bridge) as driver:
        watcher.send(Stop(by="guard", reason="smoke"))
        await driver.heard(lambda feedback: feedback.stop.stopped)
    code, _, err = await check(url(bridge.address), "--yes")
    assert code == 1
    assert "the robot is stopped by 'guard' (smoke): reset it first" in err
    async with operator(bridge, armed=False) as driver:
        assert driver.feedback.stop.stopped


async def test_somebody_else_s_stop_ends_the_check_and_stays() -> None:
    async with Bridge(create(), BridgeSettings(port=0)) as bridge:
        checking = asyncio.create_task(check(url(bridge.address), "--yes", "--case", "late", "--case", "hold"))
        async with RobotLink(*bridge.address, "events") as watcher:
            while bridge.counters.executed == 0:
                await anext(watcher)
            watcher.send(Stop(by="guard", reason="smoke"))
            code, out, _ = await checking
        assert code == 1
        assert out.count("not tried") == 3
        assert "somebody stopped the robot: guard: smoke" in out
        async with operator(bridge, armed=False) as driver:
            assert driver.feedback.stop.by == "guard"


async def test_a_bridge_with_tls_and_a_secret_is_checked_and_strangers_are_refused(tmp_path: Path) -> None:
    secret, authority = LinkSecret.draw(), Authority(tmp_path)
    (tmp_path / "secret").write_text(secret.reveal())
    settings = BridgeSettings(port=0, secret=secret, tls=LinkTls(certificate=authority.issue("bridge")))
    async with Bridge(create(), settings) as bridge:
        where = (url(bridge.address, "tls"), "--yes", "--link-tls-ca", str(authority.certificate))
        known = ("--link-secret-file", str(tmp_path / "secret"), "--case", "secret", "--case", "executes")
        code, out, err = await check(*where, *known)
        assert (code, out.splitlines()[-1], err) == (0, "2 ok", "")
        code, _, err = await check(*where)
        assert code == 1
        assert "unauthorised" in err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("http://127.0.0.1:1",), "is not tcp://host:port"),
        (("127.0.0.1:5600",), "is not tcp://host:port"),
        (("tcp://127.0.0.1",), "is not tcp://host:port"),
        (("tcp://127.0.0.1:99999",), "is not tcp://host:port"),
        (("tcp://127.0.0.1:1", "--case", "tea"), "no case 'tea'; there are hello,"),
        (("tcp://127.0.0.1:1", "--link-secret-file", "/none"), "cannot read the link secret"),
    ],
)
async def test_what_cannot_be_meant_is_a_usage_error(arguments: tuple[str, ...], words: str) -> None:
    code, _, err = await check(*arguments, "--yes")
    assert code == 2
    assert words in err
    assert "Traceback" not in err


async def test_where_nobody_listens_it_says_so() -> None:
    code, _, err = await check("tcp://127.0.0.1:1", "--yes")
    assert code == 1
    assert err.startswith("lockstep check: 127.0.0.1:1: ")
