"""Checks that the robot link may listen on its address, before it does."""

from lockstep.robot_bridge.errors import InsecureLink
from lockstep.robot_bridge.loopback import is_loopback
from lockstep.robot_bridge.settings import BridgeSettings

__all__ = ["check_link"]


def check_link(settings: BridgeSettings) -> None:
    """Check that only clients that may drive the robot can reach the link.

    Raises:
        InsecureLink: nothing would keep strangers from driving the robot.
    """
    if not settings.listen or settings.insecure or settings.secret is not None or is_loopback(settings.host):
        return
    if settings.tls is not None and settings.tls.authority is not None:
        return
    raise InsecureLink(
        f"any client that reaches {settings.host or 'this machine'} could drive the robot: give --link-secret-file, or"
        " --link-tls-cert with --link-tls-ca for client certificates, or --insecure-link if that is wanted"
    )
