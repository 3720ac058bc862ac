"""A Redis that is away, hung, full, locked or full of rubbish disturbs nobody, and is named."""

import asyncio
import re
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from lockstep.server.audit.records import Actor, AuditRecord
from lockstep.server.federation.envelope import Seal
from lockstep.server.federation.messages import MAX_PUBLISHED, Published, pack_published
from lockstep.server.federation.redis import redis_board, stop_exchange
from lockstep.server.federation.redis.redis_private import LARGEST
from lockstep.server.federation.robot_summary import within_bounds
from lockstep.server.stop.stop_presses import new_press
from tests.server.federation.boards import KEY, running_board, tile
from tests.support.certificates import Authority
from tests.support.redis_server import RedisServer
from tests.waiting import eventually

ANN = Actor("Ann", "operator")
NOTE = AuditRecord(n=1, time=1.0, kind="note")
GUIDE = Path(__file__).parents[4] / "docs" / "fleet.md"
PASSWORD = "correct-horse-battery-staple"
STRANGER = "0123456789abcdef"


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(redis_board, "PERIOD", 0.3)
    monkeypatch.setattr(stop_exchange, "STOP_PATIENCE", 3.0)


@pytest.fixture
async def server(tmp_path: Path) -> AsyncIterator[RedisServer]:
    async with RedisServer(tmp_path) as running:
        yield running


async def test_a_hung_redis_is_named_and_what_was_known_of_others_turns_unknown_until_it_goes_on(
    server: RedisServer,
) -> None:
    async with running_board(server.url, "one", tile("left")) as one, running_board(server.url, "two") as two:
        await eventually(lambda: one.state.unknown_since is None and two.others())
        server.hang()
        await eventually(lambda: two.state.unknown_since is not None and two.others()[0].link == "unknown")
        assert two.state.detail.startswith("silent: ")
        assert two.others()[0].name == "left"
        assert not (await two.audit(1)).complete
        server.go_on()
        await eventually(lambda: two.state.unknown_since is None and two.others()[0].link == "up")


async def test_a_board_ends_while_redis_hangs(server: RedisServer) -> None:
    async with running_board(server.url, "one", tile("left")) as one:
        await eventually(lambda: one.state.unknown_since is None)
        server.hang()


async def test_a_wrong_password_is_named_and_never_shown(tmp_path: Path) -> None:
    async with RedisServer(tmp_path, password=PASSWORD) as server:
        wrong = f"redis://:{PASSWORD}-not@127.0.0.1:{server.port}/0"
        with capture_logs() as logs:
            async with running_board(wrong, "one") as one:
                await eventually(lambda: one.state.detail.startswith("refused"))
                await one.stop(["left"], new_press(ANN, "http", ""))
                shown = f"{one.state} {logs}"
            assert one.count("lockstep_board_failures_total", reason="refused") >= 1
            assert PASSWORD not in shown
            async with running_board(server.url, "two") as two:
                await eventually(lambda: two.state.unknown_since is None)
        assert PASSWORD not in str(logs)


async def test_a_full_redis_keeps_others_known_and_says_that_this_console_is_not_shown(server: RedisServer) -> None:
    async with running_board(server.url, "one", tile("left")) as one, running_board(server.url, "two") as two:
        await eventually(lambda: two.others() and one.state.unknown_since is None)
        async with server.client() as client:
            await client.config_set("maxmemory", "1")
            two.record("far", NOTE)
            await eventually(lambda: "full" in two.state.detail)
            assert two.state.unknown_since is None
            assert not (await two.audit(1)).complete
            await client.config_set("maxmemory", "0")
        await eventually(lambda: two.state.detail == "")
        assert two.count("lockstep_board_failures_total", reason="full") >= 1


async def test_a_value_of_another_kind_at_a_key_of_ours_is_named(server: RedisServer) -> None:
    async with server.client() as client:
        await client.set("lockstep:consoles", "rubbish")
        await client.set("lockstep:audit", "rubbish")
        async with running_board(server.url, "one", tile("left")) as one:
            await eventually(lambda: one.state.detail.startswith("wrong_type"))
            one.record("left", NOTE)
            await client.delete("lockstep:consoles")
            await eventually(lambda: one.state.unknown_since is None)
            found = await one.audit(10)
            assert (found.records, found.complete) == ([], False)
            assert found.detail.startswith("wrong_type")
            await client.delete("lockstep:audit")
            async with asyncio.timeout(20):
                while not (await one.audit(10)).records:  # noqa: ASYNC110
                    await asyncio.sleep(0.05)


async def test_what_no_console_wrote_is_counted_by_name_and_shown_to_nobody(server: RedisServer) -> None:
    good = within_bounds(tile("far"), "https://far.example")
    stranger = Published(id=STRANGER, name="stranger", n=1, robots=(good,))
    async with server.client() as client:

        async def put(value: bytes, console: str = STRANGER) -> None:
            await client.zadd("lockstep:consoles", {console: 2e9})
            await client.set(f"lockstep:console:{console}", value)

        async with running_board(server.url, "one", tile("left")) as one:

            async def counted(reason: str, metric: str = "bad_input") -> None:
                name = f"lockstep_board_{metric}_total"
                before = one.count(name, reason=reason)
                await eventually(lambda: one.count(name, reason=reason) > before)

            await eventually(lambda: one.state.unknown_since is None)
            await put(b"rubbish")
            await counted("not_sealed")
            await put(pack_published(Seal("another signing key, of another fleet"), stranger))
            await counted("not_sealed")
            await put(b"x" * (MAX_PUBLISHED * 4))
            await counted("too_large")
            await put(Seal(KEY).put("console", b'{"id":"' + b"[" * 5000))
            await counted("malformed")
            bad = Published(id=STRANGER, name="s", n=2, robots=(tile("far", url="javascript:alert(1)"),))
            await put(pack_published(Seal(KEY), bad))
            await counted("malformed")
            await client.delete(f"lockstep:console:{STRANGER}")
            await client.lpush(f"lockstep:console:{STRANGER}", "x")
            await counted("wrong_type", "failures")
            await client.publish("lockstep:news", b"rubbish")
            await counted("not_sealed")
            await client.xadd("lockstep:audit", {b"line": b"{}"})
            assert (await one.audit(10)).records == []
            await client.zadd("lockstep:revoked", {b"rubbish": 2e9})
            assert one.others() == []
            assert one.state.unknown_since is None, "nothing of this is trouble with the board"
            await client.delete(f"lockstep:console:{STRANGER}")
            await put(pack_published(Seal(KEY), stranger))
            await eventually(one.others)


async def test_a_string_of_any_size_costs_no_more_than_one_of_ours(server: RedisServer) -> None:
    async with server.client() as client, running_board(server.url, "one", tile("left")) as one:
        await eventually(lambda: one.state.unknown_since is None)
        await client.xadd("lockstep:audit", {b"line": b"x" * (LARGEST + 1)})
        found = await one.audit(10)
        assert (found.records, found.complete) == ([], False)
        assert found.detail.startswith("too_large")
        assert one.count("lockstep_board_bad_input_total", reason="too_large") == 1


async def test_a_stop_comes_through_a_flood_of_news(server: RedisServer) -> None:
    async with (
        server.client() as client,
        running_board(server.url, "one", tile("left")) as one,
        running_board(server.url, "two") as two,
    ):
        await eventually(two.others)
        for _ in range(5):
            pipeline = client.pipeline(transaction=False)
            for _ in range(100):
                pipeline.publish("lockstep:news", b"x" * 100)
            await pipeline.execute()
        answers = await two.stop(["left"], new_press(ANN, "http", ""))
        assert answers["left"].delivered
        await eventually(lambda: one.count("lockstep_board_bad_input_total", reason="not_sealed") == 500)


async def test_records_beyond_the_bound_are_lost_and_counted_while_redis_is_away(tmp_path: Path) -> None:
    server = RedisServer(tmp_path)
    async with running_board(server.url, "one") as one:
        for n in range(2049):
            one.record("left", AuditRecord(n=n + 1, time=float(n), kind="note"))
        assert one.count("lockstep_board_lost_total", what="audit") == 1
        async with server:
            async with asyncio.timeout(15):
                while len(found := (await one.audit(500)).records) < 500 or found[-1].record.n != 2049:  # noqa: ASYNC110
                    await asyncio.sleep(0.05)


async def test_encrypted_and_with_a_password(tmp_path: Path) -> None:
    authority = Authority(tmp_path)
    files = str(authority.issue("redis"))
    options = ["--tls-cert-file", files, "--tls-key-file", files, "--tls-ca-cert-file", str(authority.certificate)]
    server = RedisServer(tmp_path, *options, "--tls-auth-clients", "no", password=PASSWORD, encrypted=True)
    async with server:
        trusting = f"{server.url}?ssl_ca_certs={authority.certificate}"
        async with running_board(trusting, "one", tile("left")), running_board(trusting, "two") as two:
            await eventually(two.others)
        async with running_board(server.url, "three") as three:
            await eventually(lambda: "CERTIFICATE_VERIFY_FAILED" in three.state.detail)
            assert PASSWORD not in three.state.detail


async def test_a_user_who_may_do_no_more_than_the_guide_says_suffices(server: RedisServer) -> None:
    (rules,) = re.findall(r"An ACL may grant\s`(.*)`\sand the commands\s`(.*)`", GUIDE.read_text())
    commands = [f"+{command.lower()}" for command in rules[1].split()]
    async with server.client() as client:
        user = ("ACL", "SETUSER", "ann", "on", f">{PASSWORD}", *rules[0].split(), *commands)
        await client.execute_command(*user)  # type: ignore[no-untyped-call]
    url = f"redis://ann:{PASSWORD}@127.0.0.1:{server.port}/0"
    async with running_board(url, "one", tile("left")) as one, running_board(url, "two", tile("far")) as two:
        await eventually(lambda: one.others() and two.others())
        one.record("left", NOTE)
        one.links.revoke("abc")
        await eventually(lambda: "abc" in two.links.elsewhere)
        assert (await two.stop(["left"], new_press(ANN, "http", "")))["left"].delivered
        async with asyncio.timeout(20):
            while not (await two.audit(10)).records:  # noqa: ASYNC110
                await asyncio.sleep(0.05)
    for board in (one, two):
        assert board.count("lockstep_board_failures_total", reason="refused") == 0
