"""The robot link's secret and TLS over real TCP: who is let in, who is not, and that nobody else is disturbed."""

import asyncio
import socket
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
import uvloop

from lockstep.protocol.errors import LinkError, LinkLost, LinkRefused, SecretError
from lockstep.protocol.framing import frame
from lockstep.protocol.link_secret import LinkSecret
from lockstep.protocol.messages import Feedback, Goodbye, Hello, Media, Ping, Stop, encode_message
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.errors import InsecureLink
from lockstep.robot_bridge.link.admission import link_acceptor
from lockstep.robot_bridge.link.check_link import check_link
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.robot_bridge.link.link_tls import LinkTls
from lockstep.robot_bridge.loopback import is_loopback
from lockstep.robot_bridge.settings import BridgeSettings
from tests.robot_bridge.bridge_helpers import PATIENCE, Operator, RecordingRobot, raw_link
from tests.support.certificates import Authority

SECRET = LinkSecret.draw()


@asynccontextmanager
async def bridge_with(
    secret: LinkSecret | None = None,
    tls: LinkTls | None = None,
    *,
    max_strangers: int = 16,
    max_links: int = 32,
    media: bool = False,
) -> AsyncIterator[Bridge]:
    settings = BridgeSettings(port=0, secret=secret, tls=tls, max_strangers=max_strangers, max_links=max_links)
    async with Bridge(RecordingRobot(media=media), settings) as bridge:
        yield bridge
    assert bridge.links == 0
    assert {task for task in asyncio.all_tasks() if task is not asyncio.current_task()} == set()


def link_to(bridge: Bridge, secret: LinkSecret | None = SECRET, tls: LinkTls | None = None) -> RobotLink:
    context = None if tls is None else tls.client_context()
    return RobotLink(*bridge.address, "operator", name="test", secret=secret, tls=context)


async def drives(link: RobotLink) -> None:
    driver = Operator(link)
    await driver.next(Feedback)
    await driver.arm()
    await driver.drive()


async def test_a_client_with_the_secret_drives() -> None:
    async with bridge_with(SECRET) as bridge, link_to(bridge) as link:
        await drives(link)


@pytest.mark.parametrize("secret", [None, LinkSecret.draw()])
async def test_a_wrong_or_missing_secret_is_refused_and_counted(secret: LinkSecret | None) -> None:
    async with bridge_with(SECRET) as bridge:
        with pytest.raises(LinkRefused, match="unauthorised"):
            await link_to(bridge, secret).connect()
        assert bridge.counters.bad_input == {"unauthorised": 1}
        assert bridge.counters.endings["unauthorised"] == 1
        assert bridge.counters.executed == 0


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.2"])
async def test_however_often_somebody_fails_from_an_address_the_right_secret_gets_in_from_there(host: str) -> None:
    async with bridge_with(SECRET) as bridge:
        for _ in range(50):
            reader, writer = await asyncio.open_connection(*bridge.address, local_addr=(host, 0))
            writer.write(frame(encode_message(Hello(role="operator"))))
            async with asyncio.timeout(PATIENCE):
                await reader.read()
            writer.close()
        for _ in range(10):
            with pytest.raises(LinkRefused, match="wrong link secret"):
                await link_to(bridge, LinkSecret.draw()).connect()
        async with link_to(bridge) as link:
            await drives(link)
        assert bridge.counters.bad_input["unauthorised"] == 60


@pytest.mark.parametrize("beginning", [b"", frame(encode_message(Hello(role="operator", nonce=b"n" * 32)))])
async def test_strangers_that_say_nothing_or_owe_the_proof_keep_nobody_out(beginning: bytes) -> None:
    async with bridge_with(SECRET, max_strangers=3) as bridge:
        strangers = []
        try:
            for _ in range(20):
                reader, writer = await asyncio.open_connection(*bridge.address)
                strangers.append(writer)
                writer.write(beginning)
                if beginning:
                    await reader.read(1)  # of the challenge
            async with link_to(bridge) as link:
                await drives(link)
            assert bridge.counters.endings["full"] >= 17
        finally:
            for writer in strangers:
                writer.close()


async def test_an_address_with_many_strangers_takes_no_place_from_another() -> None:
    async with bridge_with(SECRET, max_strangers=3) as bridge:
        patient = await asyncio.open_connection(*bridge.address)
        many = [await asyncio.open_connection(*bridge.address, local_addr=("127.0.0.2", 0)) for _ in range(9)]
        await happens(lambda: bridge.counters.endings["full"] == 7)
        patient[1].write(frame(encode_message(Hello(role="operator", nonce=b"n" * 32))))
        async with asyncio.timeout(PATIENCE):
            assert b"challenge" in await patient[0].read(64)
        for _, writer in (patient, *many):
            writer.transport.abort()


async def test_who_has_said_hello_is_not_pushed_out_by_those_of_the_same_address_that_say_nothing() -> None:
    async with bridge_with(SECRET, max_strangers=3) as bridge:
        reader, early = await asyncio.open_connection(*bridge.address)
        early.write(frame(encode_message(Hello(role="operator", nonce=b"n" * 32))))
        async with asyncio.timeout(PATIENCE):
            assert b"challenge" in await reader.read(1024)
        silent = [(await asyncio.open_connection(*bridge.address))[1] for _ in range(9)]
        await happens(lambda: bridge.counters.endings["full"] == 6)
        early.write(frame(encode_message(Hello(role="operator", nonce=b"n" * 32, proof=b"p" * 32))))
        async with asyncio.timeout(PATIENCE):
            assert b"wrong link secret" in await reader.read()
        for writer in (early, *silent):
            writer.transport.abort()


async def test_connections_are_accepted_at_a_bounded_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link_acceptor, "BURST", 2)
    monkeypatch.setattr(link_acceptor, "RATE", 0.001)
    async with bridge_with(SECRET) as bridge:
        connections = [await asyncio.open_connection(*bridge.address) for _ in range(5)]
        reader, writer = connections[0]
        writer.write(frame(encode_message(Hello(role="operator"))))
        async with asyncio.timeout(PATIENCE):
            await reader.read()
        assert bridge.links <= 2
        for _, each in connections:
            each.transport.abort()


async def test_strangers_do_not_count_as_links_and_links_are_bounded() -> None:
    async with (
        bridge_with(SECRET, max_links=1) as bridge,
        raw_link(bridge),
        raw_link(bridge),
        link_to(bridge) as link,
    ):
        await drives(link)
        with pytest.raises(LinkRefused, match="takes at most 1 links"):
            await RobotLink(*bridge.address, "media", secret=SECRET).connect()


async def test_a_stop_without_the_secret_is_not_heard() -> None:
    async with bridge_with(SECRET) as bridge, raw_link(bridge) as stranger:
        stranger.send(Stop(reason="from a stranger"))
        assert (await stranger.find(Goodbye)).error == "handshake"
        async with link_to(bridge) as link:
            await drives(link)


@pytest.fixture(scope="module")
def authority(tmp_path_factory: pytest.TempPathFactory) -> Authority:
    return Authority(tmp_path_factory.mktemp("certificates"))


async def test_a_client_drives_over_tls_with_the_secret(authority: Authority) -> None:
    tls = LinkTls(certificate=authority.issue("bridge"))
    trust = LinkTls(authority=authority.certificate)
    async with bridge_with(SECRET, tls) as bridge, link_to(bridge, tls=trust) as link:
        await drives(link)


async def test_pictures_arrive_whole_over_tls(authority: Authority) -> None:
    trust = LinkTls(authority=authority.certificate).client_context()
    seen = 0
    async with (
        asyncio.timeout(PATIENCE),
        bridge_with(SECRET, LinkTls(certificate=authority.issue("bridge")), media=True) as bridge,
        RobotLink(*bridge.address, "media", secret=SECRET, tls=trust) as link,
    ):
        async for message in link:
            if isinstance(message, Media) and message.stream == "overview":
                assert len(message.payload) == 640 * 480 * 3 // 2
                seen += 1
                if seen == 5:
                    break


async def test_a_media_link_over_tls_that_does_not_read_is_dropped_and_disturbs_nobody(authority: Authority) -> None:
    trust = LinkTls(authority=authority.certificate)
    tls = LinkTls(certificate=authority.issue("bridge"))
    async with bridge_with(None, tls, media=True) as bridge, link_to(bridge, None, trust) as link:
        _, writer = await asyncio.open_connection(*bridge.address, ssl=trust.client_context(), limit=1024)
        try:
            writer.write(frame(encode_message(Hello(role="media"))))
            await happens(lambda: bridge.links == 2)
            async with asyncio.timeout(PATIENCE):
                while bridge.links == 2:
                    writer.write(frame(encode_message(Ping(id=1))))  # it lives, but takes nothing
                    await asyncio.sleep(0.1)
            assert bridge.counters.endings == {"lost": 1}
            assert sum(bridge.drops.values()) > 0
            await drives(link)
        finally:
            writer.transport.abort()


async def test_with_client_certificates_who_has_one_drives_and_who_has_none_does_not(authority: Authority) -> None:
    tls = LinkTls(certificate=authority.issue("bridge"), authority=authority.certificate)
    known = LinkTls(certificate=authority.issue("console"), authority=authority.certificate)
    unknown = LinkTls(authority=authority.certificate)
    async with bridge_with(None, tls) as bridge:
        async with link_to(bridge, None, known) as link:
            await drives(link)
        with pytest.raises(LinkError):
            await link_to(bridge, None, unknown).connect()
        await happens(lambda: bridge.counters.bad_input["tls"] == 1)
        assert bridge.counters.executed == 2  # a neutral command and another


async def test_a_certificate_of_another_authority_lets_nobody_in_on_either_side(
    authority: Authority, tmp_path: Path
) -> None:
    stranger = Authority(tmp_path, "stranger")
    tls = LinkTls(certificate=authority.issue("bridge"), authority=authority.certificate)
    async with bridge_with(None, tls) as bridge:
        with pytest.raises(LinkLost, match="certificate verify failed"):
            await link_to(bridge, None, LinkTls(authority=stranger.certificate)).connect()
        forged = LinkTls(certificate=stranger.issue("console"), authority=authority.certificate)
        with pytest.raises(LinkError):
            await link_to(bridge, None, forged).connect()
        assert bridge.counters.executed == 0


async def test_what_is_not_tls_is_counted_and_keeps_nobody_out(authority: Authority) -> None:
    tls = LinkTls(certificate=authority.issue("bridge"))
    async with bridge_with(SECRET, tls, max_strangers=2) as bridge:
        silent = [await asyncio.open_connection(*bridge.address) for _ in range(6)]
        try:
            assert await answer_to(bridge, frame(encode_message(Stop()))) == b""
            async with link_to(bridge, tls=LinkTls(authority=authority.certificate)) as link:
                await drives(link)
            assert bridge.counters.bad_input["tls"] >= 4
        finally:
            for _, writer in silent:
                writer.close()


FIRST_RECORD = b"\x16\x03\x01\x00\x04\x01\x00\x02\x00"  # of a hello of which the rest does not come


@pytest.mark.parametrize("beginning", [b"", FIRST_RECORD], ids=["silent", "in the handshake"])
async def test_tls_clients_that_dawdle_are_no_more_than_strangers_may_be(
    authority: Authority, beginning: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("SILENCE", "HANDSHAKE_TIMEOUT"):
        monkeypatch.setattr(link_acceptor, name, 60.0)  # it is not the time that ends them
    begun: list[socket.socket] = []
    first_record = link_acceptor._first_record

    async def noted(connection: socket.socket) -> None:
        await first_record(connection)
        begun.append(connection)

    monkeypatch.setattr(link_acceptor, "_first_record", noted)
    async with bridge_with(SECRET, LinkTls(certificate=authority.issue("bridge")), max_strangers=3) as bridge:
        strangers = []
        for number in range(20):
            _, writer = await asyncio.open_connection(*bridge.address)
            strangers.append(writer)
            writer.write(beginning)
            if beginning:
                await happens(lambda number=number: len(begun) > number)  # type: ignore[misc]
        await happens(lambda: bridge.counters.bad_input["tls"] == 17)
        async with link_to(bridge, tls=LinkTls(authority=authority.certificate)) as link:
            await drives(link)
        assert bridge.counters.bad_input["tls"] <= 18, "one more has made room for it at most"
        for writer in strangers:
            writer.transport.abort()


def test_it_all_holds_on_the_event_loop_that_the_bridge_runs_on(authority: Authority) -> None:
    """uvloop has its own TLS."""

    async def scenario() -> None:
        await test_with_client_certificates_who_has_one_drives_and_who_has_none_does_not(authority)
        await test_what_is_not_tls_is_counted_and_keeps_nobody_out(authority)
        await test_pictures_arrive_whole_over_tls(authority)
        await test_a_media_link_over_tls_that_does_not_read_is_dropped_and_disturbs_nobody(authority)
        await test_strangers_that_say_nothing_or_owe_the_proof_keep_nobody_out(b"")

    uvloop.run(scenario())


async def answer_to(bridge: Bridge, data: bytes) -> bytes:
    """What comes back before the bridge closes the connection."""
    reader, writer = await asyncio.open_connection(*bridge.address)
    try:
        writer.write(data)
        async with asyncio.timeout(PATIENCE):
            return await reader.read()
    except ConnectionError:
        return b""
    finally:
        writer.close()


async def happens(condition: Callable[[], bool]) -> None:
    """For counters, which have no event to wait for."""
    async with asyncio.timeout(PATIENCE):
        while not condition():  # noqa: ASYNC110
            await asyncio.sleep(0.01)


def test_beyond_loopback_a_bridge_needs_a_secret_or_client_certificates_or_to_be_told() -> None:
    certificate = LinkTls(certificate=Path("bridge.pem"))
    mutual = LinkTls(certificate=Path("bridge.pem"), authority=Path("ca.pem"))
    for host in ("0.0.0.0", "192.0.2.7", "::", "robot.example.org", ""):
        with pytest.raises(InsecureLink, match="--insecure-link"):
            check_link(BridgeSettings(host=host))
        with pytest.raises(InsecureLink):
            check_link(BridgeSettings(host=host, tls=certificate))
        check_link(BridgeSettings(host=host, secret=SECRET))
        check_link(BridgeSettings(host=host, tls=mutual))
        check_link(BridgeSettings(host=host, insecure=True))
    for host in ("127.0.0.1", "127.3.2.1", "::1", "localhost"):
        assert is_loopback(host)
        check_link(BridgeSettings(host=host))


def test_tls_files_that_are_no_good_are_named(tmp_path: Path) -> None:
    (tmp_path / "empty.pem").touch()
    for tls in (LinkTls(), LinkTls(certificate=tmp_path / "none.pem"), LinkTls(certificate=tmp_path / "empty.pem")):
        with pytest.raises(SecretError):
            tls.bridge_context()
    with pytest.raises(SecretError):
        LinkTls(authority=tmp_path / "none.pem").client_context()
