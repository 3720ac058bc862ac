"""Addresses and ports that media cannot use are named before anything runs."""

import socket

import pytest

from lockstep.bench.harness.free_port import free_port
from lockstep.server.settings import Settings
from lockstep.server.webrtc.media_addresses import MediaPortTaken, NoSuchAddress, check_media_addresses


def test_addresses_of_this_machine_are_taken() -> None:
    check_media_addresses(Settings(ice_hosts=("127.0.0.1", "127.0.0.2")))


@pytest.mark.parametrize("address", ["203.0.113.1", "2001:db8::1"])
@pytest.mark.parametrize("port", [0, 1])
def test_an_outer_address_is_refused_and_the_words_say_where_it_belongs(address: str, port: int) -> None:
    with pytest.raises(NoSuchAddress, match=f"media cannot use {address} .*--advertise"):
        check_media_addresses(Settings(ice_hosts=(address,), media_port=port and 40_000))


@pytest.mark.parametrize(("transport", "kind"), [("UDP", socket.SOCK_DGRAM), ("TCP", socket.SOCK_STREAM)])
def test_a_port_that_somebody_has_is_refused_by_name(transport: str, kind: socket.SocketKind) -> None:
    with socket.socket(socket.AF_INET, kind) as other:
        other.bind(("127.0.0.1", free_port()))
        if kind == socket.SOCK_STREAM:
            other.listen()
        port = other.getsockname()[1]
        settings = Settings(ice_hosts=("127.0.0.1",), media_port=port, media_tcp=True)
        with pytest.raises(MediaPortTaken, match=f"{transport} port {port} of 127.0.0.1.*--media-port"):
            check_media_addresses(settings)
    check_media_addresses(settings)
