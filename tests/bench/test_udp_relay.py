import asyncio

import pytest

from bench.udp_relay import FROZEN_BOUND, ImpairedPath, Impairment, UdpRelay


def fates(seed: int, impairment: Impairment, count: int = 500) -> list[float | None]:
    path = ImpairedPath(impairment, seed)
    return [path.admit() for _ in range(count)]


def test_the_same_seed_loses_the_same_packets() -> None:
    lossy = Impairment(delay=0.05, loss=0.05, jitter=0.01)
    assert fates(3, lossy) == fates(3, lossy)
    assert fates(3, lossy) != fates(4, lossy)


def test_loss_and_delay_are_as_asked() -> None:
    path = ImpairedPath(Impairment(delay=0.05, loss=0.05, jitter=0.01), 1)
    delays = [delay for _ in range(10_000) if (delay := path.admit()) is not None]
    assert 0.04 < path.lost / 10_000 < 0.06
    assert path.passed == len(delays)
    assert 0.05 <= min(delays) < max(delays) <= 0.06


def test_what_is_changed_on_the_way_does_not_change_the_pattern_after_it() -> None:
    path = ImpairedPath(Impairment(), 1)
    for _ in range(100):
        path.admit()
    path.impairment = Impairment(loss=0.5)
    assert [path.admit() is None for _ in range(100)] == [
        fate is None for fate in fates(1, Impairment(loss=0.5))[100:200]
    ]


class Ends(asyncio.DatagramProtocol):
    """One end of the relayed path."""

    def __init__(self) -> None:
        self.received: asyncio.Queue[bytes] = asyncio.Queue(FROZEN_BOUND)

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        self.received.put_nowait(data)


def candidate(port: int) -> str:
    return f"m=audio 9 X\r\na=candidate:1 1 udp 5 127.0.0.1 {port} typ host\r\n"


def port_in(sdp: str) -> int:
    return int(sdp.split(" typ host")[0].rsplit(" ", 1)[1])


async def test_packets_pass_both_ways_and_wait_while_it_is_frozen() -> None:
    loop = asyncio.get_running_loop()
    async with UdpRelay(Impairment(delay=0.001)) as relay, asyncio.timeout(5):
        client_transport, client = await loop.create_datagram_endpoint(Ends, local_addr=("127.0.0.1", 0))
        console_transport, console = await loop.create_datagram_endpoint(Ends, local_addr=("127.0.0.1", 0))
        to_client = ("127.0.0.1", port_in(relay.offer(candidate(client_transport.get_extra_info("sockname")[1]))))
        to_console = ("127.0.0.1", port_in(relay.answer(candidate(console_transport.get_extra_info("sockname")[1]))))
        client_transport.sendto(b"up", to_console)
        assert await console.received.get() == b"up"
        console_transport.sendto(b"down", to_client)
        assert await client.received.get() == b"down"
        relay.freeze()
        client_transport.sendto(b"later", to_console)
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.05):
                await console.received.get()
        relay.thaw()
        assert await console.received.get() == b"later"
        client_transport.close()
        console_transport.close()


async def test_packets_of_strangers_do_not_pass() -> None:
    loop = asyncio.get_running_loop()
    async with UdpRelay() as relay, asyncio.timeout(5):
        client_transport, _ = await loop.create_datagram_endpoint(Ends, local_addr=("127.0.0.1", 0))
        console_transport, console = await loop.create_datagram_endpoint(Ends, local_addr=("127.0.0.1", 0))
        stranger, _ = await loop.create_datagram_endpoint(Ends, local_addr=("127.0.0.1", 0))
        relay.offer(candidate(client_transport.get_extra_info("sockname")[1]))
        to_console = ("127.0.0.1", port_in(relay.answer(candidate(console_transport.get_extra_info("sockname")[1]))))
        stranger.sendto(b"strange", to_console)
        client_transport.sendto(b"known", to_console)
        assert await console.received.get() == b"known"
        for transport in (client_transport, console_transport, stranger):
            transport.close()
