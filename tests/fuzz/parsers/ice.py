"""What ICE must withstand, as one function of bytes.

The first byte chooses who reads the rest: the STUN codec, the agents of a port that are connected or not, a candidate's
line, or the frames of a TCP connection. Only the documented errors come out, and what is read survives being written.
"""

from random import Random

from lockstep.rtc.addresses import Path
from lockstep.rtc.ice.agent import Agent
from lockstep.rtc.ice.candidates import CandidateError, parse_candidate
from lockstep.rtc.ice.credentials import Credentials
from lockstep.rtc.ice.gathering import gather
from lockstep.rtc.ice.port import Port
from lockstep.rtc.ice.tcp import TcpFraming, frame
from lockstep.rtc.stun import StunError, is_authentic, parse, serialize, transaction_of, username_of

__all__ = ["HERE", "PASSWORD", "THERE", "try_input"]

HERE, THERE = ("192.0.2.1", 5000), ("198.51.100.7", 5000)
PASSWORD = "VOkJxbRl1RmTxUk/WvJxBt"  # of RFC 5769
UFRAG = "evtj"


def message(data: bytes) -> None:
    head, _ = transaction_of(data), username_of(data)
    try:
        found = parse(data)
    except StunError:
        return
    if head is None or head[1] != found.transaction:
        raise AssertionError("the first look and the parser disagree")
    is_authentic(data, PASSWORD)
    again = parse(serialize(found))
    if again != found and not found.not_understood:
        raise AssertionError(f"{found} becomes {again}")


def agent(data: bytes) -> None:
    """One whose password the corpus knows, so that its checks are heard."""
    port = Port()
    rng = Random(1)
    ours = Agent(gather([HERE[0]], HERE[1]), controlling=False, directory=port.directory, rng=rng)
    session = ours._sessions.newest
    del port.directory.ufrags[session.local_credentials.ufrag]
    session.local_credentials = Credentials(UFRAG, PASSWORD)
    port.directory.ufrags[UFRAG] = ours
    ours.set_remote(Credentials("h6vY", PASSWORD), [], 0.0)
    now = 0.0
    for datagram in TcpFraming().receive_bytes(data):
        path = Path(HERE, THERE)
        if port.route(datagram, path, now) is ours:
            ours.receive_datagram(datagram, path, now)
        ours.datagrams_to_send()
        ours.events()
        now = min(ours.timer() or now, now + 1.0)
        ours.handle_timer(now)
    if port.directory.size > 50:
        raise AssertionError("it grows")


def line(data: bytes) -> None:
    try:
        found = parse_candidate(data.decode(errors="replace"))
    except CandidateError:
        return
    if parse_candidate(found.line()) != found:
        raise AssertionError(f"{found} does not survive")


def stream(data: bytes) -> None:
    whole, pieces = TcpFraming(), TcpFraming()
    at_once = whole.receive_bytes(data)
    one_by_one = [each for byte in data for each in pieces.receive_bytes(bytes((byte,)))]
    if at_once != one_by_one:
        raise AssertionError("the pieces make a difference")
    if not whole.too_long and whole.counts["empty_frame"] == 0 and not data.startswith(b"".join(map(frame, at_once))):
        raise AssertionError("frames that were not there")


def try_input(data: bytes) -> None:
    """Raises whatever goes wrong."""
    readers = (message, agent, line, stream)
    readers[(data[0] if data else 0) % len(readers)](data[1:])
