"""The names of clients and ways."""

from typing import Literal

__all__ = ["Client", "Way"]

Client = Literal["chromium", "firefox", "headless", "aiortc", "gstreamer", "janus"]
Way = Literal[
    "udp",  # nothing in the way
    "tcp",  # no UDP passes: ICE-TCP
    "turn",  # only through a coturn beside the console
    "nat",  # the console is in a cloud behind one-to-one NAT and advertises its outer address; a firewall at home
    "ipv6",  # over IPv6 alone
    "far",  # 600 ms round trip
    "two",  # two consoles on one machine at the same time
]
