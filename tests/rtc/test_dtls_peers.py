"""Our DTLS with aiortc's and with the tools of OpenSSL."""

import asyncio
import os
import select
import shutil
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

import pytest
from aiortc import RTCCertificate, RTCDtlsParameters, RTCDtlsTransport, RTCIceTransport
from aiortc.rtcdtlstransport import RTCDtlsFingerprint
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import rsa

from lockstep.bench.harness.free_port import free_port
from lockstep.rtc.certificate import Certificate
from lockstep.rtc.dtls import DtlsClosed, DtlsConnected, DtlsConnection, DtlsData, DtlsEvent, DtlsRole, dtls_context
from lockstep.rtc.fingerprint import Fingerprint
from lockstep.rtc.srtp import SrtpReceiver, SrtpSender

OPENSSL = shutil.which("openssl")


class Link:
    """What aiortc's DTLS needs of ICE, with our connection at its other end."""

    def __init__(self, role: str) -> None:
        self.role = role
        self.ours: DtlsConnection
        self.events: list[DtlsEvent] = []
        self._to_aiortc: asyncio.Queue[bytes] = asyncio.Queue()

    async def _send(self, data: bytes) -> None:
        self.ours.receive_datagram(data, time.monotonic())
        self.flush()

    async def _recv(self) -> bytes:
        return await self._to_aiortc.get()

    def flush(self) -> None:
        self.events += self.ours.events()
        for data in self.ours.datagrams_to_send():
            self._to_aiortc.put_nowait(data)


class Receiver:
    def __init__(self) -> None:
        self.received: asyncio.Queue[bytes] = asyncio.Queue()

    async def _handle_data(self, data: bytes) -> None:
        self.received.put_nowait(data)


@pytest.mark.parametrize("role", ["client", "server"])
async def test_aiortc_and_we_exchange_data_and_have_the_same_srtp_keys(role: DtlsRole) -> None:
    own, theirs = Certificate.generate(), RTCCertificate.generateCertificate()
    link = Link("controlling" if role == "client" else "controlled")  # aiortc: the controlling one is the server
    expected = [Fingerprint(each.algorithm, each.value) for each in theirs.getFingerprints()]
    link.ours = DtlsConnection(dtls_context(own), role, expected)
    aiortc = RTCDtlsTransport(cast(RTCIceTransport, link), [theirs])
    receiver = Receiver()
    aiortc._register_data_receiver(receiver)
    of_ours = RTCDtlsFingerprint(own.fingerprint.algorithm, own.fingerprint.value)
    link.ours.start(time.monotonic())
    link.flush()
    await aiortc.start(RTCDtlsParameters(fingerprints=[of_ours]))
    assert aiortc.state == "connected"
    link.ours.send(b"hello", time.monotonic())
    link.flush()
    assert await receiver.received.get() == b"hello"
    await aiortc._send_data(b"and back")
    await aiortc.stop()
    connected, *rest = link.events
    assert isinstance(connected, DtlsConnected)
    assert connected.srtp is not None
    assert rest == [DtlsData(b"and back"), DtlsClosed()]
    packet = bytes.fromhex("8060000100000000000000ff") + b"media"
    sessions = cast(Any, aiortc)
    assert SrtpReceiver(connected.srtp).unprotect(sessions._tx_srtp.protect(packet)) == packet
    assert sessions._rx_srtp.unprotect(SrtpSender(connected.srtp).protect(packet)) == packet


@contextmanager
def tool(*arguments: str) -> Iterator["subprocess.Popen[bytes]"]:
    assert OPENSSL is not None
    process = subprocess.Popen([OPENSSL, *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=-2)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def output_until(process: "subprocess.Popen[bytes]", text: bytes) -> bytes:
    assert process.stdout is not None
    found = b""
    while text not in found:
        more = os.read(process.stdout.fileno(), 4096)
        assert more, found.decode(errors="replace")
        found += more
    return found


def run(connection: DtlsConnection, udp: socket.socket, done: Callable[[list[DtlsEvent]], bool]) -> list[DtlsEvent]:
    """Move datagrams until `done`."""
    events: list[DtlsEvent] = []
    while True:
        for data in connection.datagrams_to_send():
            udp.send(data)
        events += connection.events()
        if done(events):
            return events
        due = connection.timer()
        wait = None if due is None else max(0.0, due - time.monotonic())
        if select.select([udp], [], [], wait)[0]:
            try:
                data = udp.recv(65536)
            except ConnectionRefusedError:
                continue  # the tool does not listen yet
            connection.receive_datagram(data, time.monotonic())
        else:
            connection.handle_timer(time.monotonic())


def written(certificate: Certificate, folder: Path) -> tuple[str, ...]:
    pem = serialization.Encoding.PEM
    (folder / "cert.pem").write_bytes(certificate.certificate.public_bytes(pem))
    key = certificate.key.private_bytes(pem, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    (folder / "key.pem").write_bytes(key)
    return "-cert", str(folder / "cert.pem"), "-key", str(folder / "key.pem")


def of_kind(kind: str) -> Certificate:
    if kind == "rsa":
        return Certificate.for_key(rsa.generate_private_key(65537, 2048))
    return Certificate.generate()


needs_openssl = pytest.mark.skipif(OPENSSL is None, reason="the command openssl is not installed")


@needs_openssl
@pytest.mark.parametrize("kind", ["ecdsa", "rsa"])
def test_we_are_the_client_of_openssl(kind: str, tmp_path: Path) -> None:
    theirs, port = of_kind(kind), free_port()
    options = ("-dtls1_2", "-Verify", "1", "-use_srtp", "SRTP_AES128_CM_SHA1_80", "-accept", f"127.0.0.1:{port}")
    connection = DtlsConnection(dtls_context(Certificate.generate()), "client", [theirs.fingerprint])
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp,
        tool("s_server", *options, *written(theirs, tmp_path)) as server,
    ):
        output_until(server, b"ACCEPT")
        udp.connect(("127.0.0.1", port))
        connection.start(time.monotonic())
        [connected] = run(connection, udp, lambda events: bool(events))
        assert isinstance(connected, DtlsConnected)
        assert connected.srtp is not None
        assert connected.srtp.profile.name == "SRTP_AES128_CM_SHA1_80"
        connection.send(b"from us\n", time.monotonic())
        for data in connection.datagrams_to_send():
            udp.send(data)
        output_until(server, b"from us")
        assert server.stdin is not None
        server.stdin.write(b"from openssl\n")
        server.stdin.flush()
        assert run(connection, udp, lambda events: bool(events)) == [DtlsData(b"from openssl\n")]


@needs_openssl
@pytest.mark.parametrize("kind", ["ecdsa", "rsa"])
def test_we_are_the_server_of_openssl(kind: str, tmp_path: Path) -> None:
    theirs = of_kind(kind)
    connection = DtlsConnection(dtls_context(Certificate.generate()), "server", [theirs.fingerprint])
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        udp.bind(("127.0.0.1", 0))
        port = udp.getsockname()[1]
        options = ("-dtls1_2", "-use_srtp", "SRTP_AEAD_AES_128_GCM", "-connect", f"127.0.0.1:{port}")
        with tool("s_client", *options, *written(theirs, tmp_path)) as client:
            connection.start(time.monotonic())
            udp.connect(udp.recvfrom(65536, socket.MSG_PEEK)[1])
            [connected] = run(connection, udp, lambda events: bool(events))
            assert isinstance(connected, DtlsConnected)
            assert connected.srtp is not None
            assert connected.srtp.profile.name == "SRTP_AEAD_AES_128_GCM"
            assert client.stdin is not None
            client.stdin.write(b"from openssl\n")
            client.stdin.flush()
            assert run(connection, udp, lambda events: bool(events)) == [DtlsData(b"from openssl\n")]
            client.stdin.write(b"Q\n")  # it says close_notify
            client.stdin.flush()
            assert run(connection, udp, lambda events: bool(events)) == [DtlsClosed()]
