"""STUN and TURN servers as aiortc takes them."""

from aiortc import RTCIceServer

from server.ice_servers import IceServers

__all__ = ["for_aiortc"]


def for_aiortc(servers: IceServers) -> list[RTCIceServer]:
    return [
        RTCIceServer(each.urls, username=each.username or None, credential=each.credential or None)
        for each in servers.ice_servers
    ]
