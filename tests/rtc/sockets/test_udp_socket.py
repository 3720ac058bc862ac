import errno
import socket
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from typing import Any

import pytest

from lockstep.rtc.addresses import Address, Datagram, Path
from lockstep.rtc.sockets.udp_socket import MAX_BACKLOG, MAX_DATAGRAM, UdpSocket

Bind = Callable[..., UdpSocket]


@pytest.fixture
def bind() -> Iterator[Bind]:
    with ExitStack() as stack:

        def bound(host: str, **options: bool) -> UdpSocket:
            made = UdpSocket.bind(host, 0, **options)
            stack.callback(made.close)
            return made

        yield bound


def between(sender: UdpSocket, receiver: UdpSocket) -> Path:
    return Path(sender.address, receiver.address)


def data_of(received: list[tuple[bytes, Path]]) -> list[bytes]:
    return [data for data, _ in received]


@pytest.mark.parametrize("host", ["127.0.0.1", "::1"])
@pytest.mark.parametrize("segments", [True, False])
def test_datagrams_arrive_in_order_and_whole(bind: Bind, host: str, segments: bool) -> None:
    here, there = bind(host, segments=segments), bind(host)
    sizes = [1200] * 30 + [700, 1200, 1200, 5, 5, 6, 0, 1200]
    sent = [bytes((place,)) * size for place, size in enumerate(sizes)]
    here.queue([Datagram(data, between(here, there)) for data in sent])
    here.flush()
    assert not here.wants_write
    received = there.receive()
    assert data_of(received) == sent
    assert {path for _, path in received} == {Path(there.address, here.address)}
    assert there.receive() == []


@pytest.mark.parametrize("asked", ["127.0.0.1", "127.0.0.2", "127.1.2.3"])
def test_an_answer_leaves_from_the_address_that_was_asked(bind: Bind, asked: str) -> None:
    console, peer = bind("0.0.0.0"), bind("127.0.0.1")
    port = console.address[1]
    peer.queue([Datagram(b"question", Path(peer.address, (asked, port)))])
    peer.flush()
    [(question, path)] = console.receive()
    assert path == Path((asked, port), peer.address)
    console.queue([Datagram(bytes(1000), path)] * 5 + [Datagram(question, path)])
    console.flush()
    assert {path.remote for _, path in peer.receive()} == {(asked, port)}


def test_an_answer_over_ipv6_leaves_from_the_address_that_was_asked(bind: Bind) -> None:
    console, peer = bind("::"), bind("::1")
    peer.queue([Datagram(b"question", Path(peer.address, ("::1", console.address[1])))])
    peer.flush()
    [(question, path)] = console.receive()
    assert path == Path(("::1", console.address[1]), peer.address)
    console.queue([Datagram(question, path)] * 3)
    console.flush()
    assert data_of(peer.receive()) == [question] * 3


def test_one_socket_talks_to_many(bind: Bind) -> None:
    console, peers = bind("127.0.0.1"), [bind("127.0.0.1") for _ in range(20)]
    for place, peer in enumerate(peers):
        console.queue([Datagram(bytes((place,)) * 100, between(console, peer))] * place)
    console.flush()
    assert [data_of(peer.receive()) for peer in peers] == [[bytes((place,)) * 100] * place for place in range(20)]


def test_urgent_datagrams_leave_first(bind: Bind) -> None:
    here, there = bind("127.0.0.1"), bind("127.0.0.1")
    here.queue([Datagram(b"media", between(here, there))] * 3)
    here.queue([Datagram(b"urgent", between(here, there))], urgent=True)
    here.flush()
    assert data_of(there.receive())[0] == b"urgent"


def test_what_is_longer_than_a_path_carries_is_counted(bind: Bind) -> None:
    here, there = bind("127.0.0.1"), bind("127.0.0.1")
    here.queue([Datagram(bytes(size), between(here, there)) for size in (MAX_DATAGRAM, MAX_DATAGRAM + 1, 3)])
    here.flush()
    assert [len(data) for data in data_of(there.receive())] == [MAX_DATAGRAM, 3]
    assert there.counts == {"too_long": 1}


def test_one_receive_takes_a_bounded_number(bind: Bind) -> None:
    here, there = bind("127.0.0.1"), bind("127.0.0.1")
    here.queue([Datagram(b"x", between(here, there))] * 100)
    here.flush()
    assert [len(there.receive()) for _ in range(3)] == [64, 36, 0]


def test_a_datagram_that_cannot_be_sent_takes_no_other_with_it(bind: Bind) -> None:
    here, there = bind("0.0.0.0"), bind("127.0.0.1")
    good = Datagram(b"good", Path(("127.0.0.1", here.address[1]), there.address))
    bad = [
        Datagram(b"bad", Path(("127.0.0.1", here.address[1]), ("2001:db8::1", 5))),
        Datagram(b"bad", Path(("not an address", here.address[1]), there.address)),
        Datagram(bytes(70_000), good.path),
    ]
    here.queue([good, *bad, good])
    here.flush()
    assert data_of(there.receive()) == [b"good"] * 2
    assert here.counts.total() == 3


class FakeSocket:
    """A kernel that does what `answers` says, one after the other; then it takes everything."""

    family = socket.AF_INET

    def __init__(self, *answers: int) -> None:
        self.answers = deque(answers)
        self.sent: list[list[bytes]] = []

    def setblocking(self, flag: bool) -> None: ...
    def setsockopt(self, *option: int) -> None: ...
    def close(self) -> None: ...

    def getsockopt(self, *option: int) -> int:
        return 0

    def getsockname(self) -> Address:
        return "0.0.0.0", 5000

    def sendmsg(self, buffers: Sequence[bytes], *_: object) -> int:
        if self.answers and (code := self.answers.popleft()):
            raise OSError(code, "as the test says")
        self.sent.append(list(buffers))
        return sum(map(len, buffers))

    def recvmsg(self, *_: object) -> Any:
        raise OSError(self.answers.popleft(), "as the test says")


def with_kernel(*answers: int) -> tuple[UdpSocket, FakeSocket]:
    kernel = FakeSocket(*answers)
    return UdpSocket(kernel), kernel  # type: ignore[arg-type]


def numbered(count: int, size: int = 100, port: int = 7000) -> list[Datagram]:
    path = Path(("192.0.2.1", 5000), ("198.51.100.7", port))
    return [Datagram(number.to_bytes(2) * (size // 2), path) for number in range(count)]


def flat(kernel: FakeSocket) -> list[int]:
    return [int.from_bytes(data[:2]) for message in kernel.sent for data in message]


@pytest.mark.parametrize("full", [errno.EAGAIN, errno.ENOBUFS])
def test_what_the_kernel_has_no_room_for_waits_and_keeps_its_order(full: int) -> None:
    here, kernel = with_kernel(0, full)
    here.queue(numbered(5) + numbered(5, port=8000))
    here.flush()
    assert len(kernel.sent) == 1
    here.queue(numbered(2, port=9000), urgent=True)
    here.flush()
    assert not here.wants_write
    assert flat(kernel) == [0, 1, 2, 3, 4, 0, 1, 0, 1, 2, 3, 4]


def test_an_urgent_datagram_is_sent_at_once_before_all_that_wait_but_urgent_ones() -> None:
    here, kernel = with_kernel()
    [first, second, third] = numbered(3)
    here.queue([second])
    assert here.send_at_once(first)
    assert flat(kernel) == [0]
    here.queue([third], urgent=True)
    assert not here.send_at_once(first)
    here.flush()
    assert flat(kernel) == [0, 2, 1]


@pytest.mark.parametrize("full", [errno.EAGAIN, errno.ENOBUFS])
def test_an_urgent_datagram_that_the_kernel_has_no_room_for_is_left_to_the_caller(full: int) -> None:
    here, kernel = with_kernel(full, 0)
    [datagram] = numbered(1)
    assert (here.send_at_once(datagram), here.is_full) == (False, True)
    assert (here.send_at_once(datagram), here.is_full) == (True, False)
    assert flat(kernel) == [0]


def test_an_urgent_datagram_that_the_kernel_refuses_is_dropped_and_counted() -> None:
    here, _ = with_kernel(errno.EPERM)
    assert here.send_at_once(*numbered(1))
    assert here.counts["EPERM"] == 1


@pytest.mark.parametrize("code", [errno.EPERM, errno.ENETUNREACH, errno.EHOSTUNREACH, errno.EADDRNOTAVAIL])
def test_what_the_kernel_refuses_is_dropped_and_counted_by_name(code: int) -> None:
    here, kernel = with_kernel(0, code)
    here.queue(numbered(1) + numbered(1, port=8000) + numbered(1, port=9000))
    here.flush()
    assert len(kernel.sent) == 2
    assert here.counts == {errno.errorcode[code]: 1}


def test_the_backlog_is_bounded_and_drops_what_waits_longest() -> None:
    here, kernel = with_kernel(errno.EAGAIN)
    here.queue(numbered(MAX_BACKLOG + 10))
    here.flush()
    here.queue(numbered(MAX_BACKLOG + 20), urgent=True)
    assert here.counts == {"backlog": 10, "backlog_urgent": 20}
    here.flush()
    assert flat(kernel) == [*range(20, MAX_BACKLOG + 20), *range(10, MAX_BACKLOG + 10)]


@pytest.mark.parametrize("code", [errno.EINVAL, errno.EIO, errno.EMSGSIZE])
def test_segments_that_the_kernel_will_not_cut_leave_one_by_one(code: int) -> None:
    here, kernel = with_kernel(code)
    here.queue(numbered(5) + numbered(3, port=8000))
    here.flush()
    assert [len(message) for message in kernel.sent] == [1, 1, 1, 1, 1, 3]
    assert here.counts == {"segments_refused": 1}


def test_a_kernel_that_never_cuts_is_not_asked_for_ever() -> None:
    here, kernel = with_kernel(*[errno.EIO, 0, 0] * 100)
    for _ in range(150):
        here.queue(numbered(2))
        here.flush()
    assert here.counts == {"segments_refused": 100}
    assert flat(kernel) == [0, 1] * 150


def test_a_message_holds_at_most_64_segments_and_what_a_length_field_can_say() -> None:
    here, kernel = with_kernel()
    here.queue(numbered(70, size=100) + numbered(70, size=1200))
    here.flush()
    assert [len(message) for message in kernel.sent] == [64, 6, 54, 16]


def test_errors_of_receiving_are_counted_and_nothing_more() -> None:
    here, _ = with_kernel(errno.ECONNREFUSED, errno.EAGAIN)
    assert here.receive() == []
    assert here.receive() == []
    assert here.counts == {"ECONNREFUSED": 1}


def test_closing_forgets_what_waits(bind: Bind) -> None:
    here, _ = with_kernel(errno.EAGAIN)
    here.queue(numbered(5))
    here.close()
    assert not here.wants_write


def test_a_port_that_is_taken_is_said_at_once(bind: Bind) -> None:
    first = bind("127.0.0.1")
    with pytest.raises(OSError, match="in use"):
        UdpSocket.bind("127.0.0.1", first.address[1])


def test_a_socket_is_full_from_when_the_kernel_takes_no_more_until_it_does() -> None:
    here, _ = with_kernel(errno.EAGAIN)
    here.queue(numbered(1))
    here.flush()
    assert here.is_full
    here.flush()
    assert not here.is_full
