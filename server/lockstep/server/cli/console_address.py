"""Where a state directory's console is, for commands that run beside it."""

import socket
from typing import Final

import msgspec

from lockstep.server.util.state_dir import StateDir

__all__ = ["ConsoleAddress", "forget_listener", "local_url", "read_address", "write_address"]

FILE: Final = "console.json"
LOOPBACK: Final = {"0.0.0.0": "127.0.0.1", "::": "::1"}  # of an address that means all of a machine


class ConsoleAddress(msgspec.Struct, frozen=True):
    """The addresses of the console that started last."""

    url: str = ""  # for others; "": no console has run with this directory
    local: str = ""  # of the listener itself, on this machine; "": it does not run any more
    certificate: str = ""  # PEM, that the console shows there; "": it does not encrypt


_decoder = msgspec.json.Decoder(ConsoleAddress)


def local_url(listener: socket.socket, *, encrypted: bool) -> str:
    """Return the URL by which this machine itself reaches `listener`, past every proxy and router."""
    host, port, *more = listener.getsockname()
    host = LOOPBACK.get(host, host)
    scope = more[1] if more else 0  # of IPv6: the interface, without which a link-local address leads nowhere
    if scope and "%" not in host:
        host = f"{host}%{_interface(scope)}"  # not "%25" (RFC 6874), which HTTP clients do not read
    return f"{'https' if encrypted else 'http'}://{f'[{host}]' if ':' in host else host}:{port}"


def _interface(index: int) -> str:
    try:
        return socket.if_indextoname(index)
    except OSError:  # it is gone
        return str(index)


def write_address(directory: StateDir, address: ConsoleAddress) -> None:
    """Write the address. The console that started last is the one that is found."""
    directory.write(FILE, msgspec.json.encode(address))


def forget_listener(directory: StateDir, address: ConsoleAddress) -> None:
    """Forget the listener of a console that ends: another program may listen there next.

    Raises:
        StateDirUnusable: it cannot be written.
    """
    if read_address(directory) == address:
        write_address(directory, ConsoleAddress(address.url))


def read_address(directory: StateDir) -> ConsoleAddress:
    """Return the address of the console that started last."""
    data = directory.read(FILE)
    try:
        return ConsoleAddress() if data is None else _decoder.decode(data)
    except (msgspec.DecodeError, UnicodeError, RecursionError):
        return ConsoleAddress()
