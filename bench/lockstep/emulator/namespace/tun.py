"""Makes a network namespace with one TUN device in it, with system calls alone. Linux, root.

The namespace has no name: it lives as long as a process in it, or a descriptor of it, so nothing is left to clean up.
"""

import ctypes
import fcntl
import os
import socket
import struct
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from lockstep.emulator.errors import NamespacesUnavailable

__all__ = ["DEVICE", "Tun", "open_tun"]

DEVICE = b"lockstep0"
TUN_FILE = Path("/dev/net/tun")
PREFIX_MASK = "255.255.255.0"

CLONE_NEWNET = 0x40000000  # sched.h
TUNSETIFF = 0x400454CA  # linux/if_tun.h
IFF_TUN, IFF_NO_PI = 0x0001, 0x1000
SIOCADDRT, SIOCGIFFLAGS, SIOCSIFFLAGS, SIOCSIFADDR, SIOCSIFNETMASK = 0x890B, 0x8913, 0x8914, 0x8916, 0x891C
IFF_UP, IFF_RUNNING = 0x1, 0x40  # linux/if.h
RTF_UP = 0x1  # linux/route.h


@dataclass(frozen=True)
class Tun:
    """A TUN device and its namespace. Close both descriptors at the end."""

    address: str
    packets: int  # descriptor: each read and each write is one IP packet
    namespace: int  # descriptor, for setns(2)

    def close(self) -> None:
        os.close(self.packets)
        os.close(self.namespace)


class _Route(ctypes.Structure):
    """struct rtentry of linux/route.h."""

    _fields_ = (
        ("pad1", ctypes.c_ulong),
        ("dst", ctypes.c_char * 16),
        ("gateway", ctypes.c_char * 16),
        ("genmask", ctypes.c_char * 16),
        ("flags", ctypes.c_ushort),
        ("pad2", ctypes.c_short),
        ("pad3", ctypes.c_ulong),
        ("pad4", ctypes.c_void_p),
        ("metric", ctypes.c_short),
        ("dev", ctypes.c_void_p),
        ("mtu", ctypes.c_ulong),
        ("window", ctypes.c_ulong),
        ("irtt", ctypes.c_ushort),
    )


def open_tun(address: str) -> Tun:
    """Open a new namespace in which `address` is the machine's own, and everything else lies behind the device.

    Raises:
        NamespacesUnavailable: names the missing part.
    """
    if not sys.platform.startswith("linux"):
        raise NamespacesUnavailable("network namespaces need Linux")
    if os.geteuid() != 0:
        raise NamespacesUnavailable("network namespaces need root; run this with sudo, or use the proxy without them")
    if not TUN_FILE.exists():
        raise NamespacesUnavailable(f"{TUN_FILE} does not exist; load the module tun, or give the container the device")
    # unshare(2) moves only the calling thread, so a separate thread leaves all others in place.
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(_open_here, address).result()


def _open_here(address: str) -> Tun:
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.unshare(CLONE_NEWNET) != 0:
        reason = os.strerror(ctypes.get_errno())
        raise NamespacesUnavailable(f"the system makes no network namespace ({reason}); a container needs SYS_ADMIN")
    opened: list[int] = []
    try:
        opened.append(os.open("/proc/thread-self/ns/net", os.O_RDONLY | os.O_CLOEXEC))
        opened.append(os.open(TUN_FILE, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC))
        fcntl.ioctl(opened[1], TUNSETIFF, struct.pack("16sH22x", DEVICE, IFF_TUN | IFF_NO_PI))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as control:
            _configure(lambda request, argument: fcntl.ioctl(control, request, argument), address)
    except OSError as error:
        for each in opened:
            os.close(each)
        raise NamespacesUnavailable(f"the TUN device cannot be set up: {error}") from error
    return Tun(address, packets=opened[1], namespace=opened[0])


def _configure(ioctl: Callable[[int, bytes], bytes], address: str) -> None:
    _bring_up(ioctl, b"lo")
    ioctl(SIOCSIFADDR, struct.pack("16s16s8x", DEVICE, _socket_address(address)))
    ioctl(SIOCSIFNETMASK, struct.pack("16s16s8x", DEVICE, _socket_address(PREFIX_MASK)))
    _bring_up(ioctl, DEVICE)
    # A default route: browsers look for the address that leads to the rest of the world.
    name = ctypes.create_string_buffer(DEVICE)
    anywhere = _socket_address("0.0.0.0")
    route = _Route(dst=anywhere, gateway=anywhere, genmask=anywhere, flags=RTF_UP, dev=ctypes.addressof(name))
    ioctl(SIOCADDRT, bytes(route))


def _bring_up(ioctl: Callable[[int, bytes], bytes], device: bytes) -> None:
    request = struct.pack("16sH22x", device, 0)
    flags: int = struct.unpack_from("16xH", ioctl(SIOCGIFFLAGS, request))[0]
    ioctl(SIOCSIFFLAGS, struct.pack("16sH22x", device, flags | IFF_UP | IFF_RUNNING))


def _socket_address(host: str) -> bytes:
    return struct.pack("=HH4s8x", socket.AF_INET, 0, socket.inet_aton(host))
