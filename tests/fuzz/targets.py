"""What is fuzzed: a name, a function of bytes, and a folder of inputs to begin with."""

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

__all__ = ["TARGETS", "Target", "corpus"]

CORPUS = Path(__file__).parent / "corpus"


class Target(NamedTuple):
    """`module` has a function `try_input(data)` that raises when something is wrong. It is imported late, so that a
    fuzzer can instrument what it imports."""

    module: str
    instrumented: tuple[str, ...]  # modules whose code the fuzzer watches

    def load(self) -> Callable[[bytes], None]:
        attempt: Callable[[bytes], None] = importlib.import_module(self.module).try_input
        return attempt


TARGETS = {
    "robot_link": Target(
        "tests.fuzz.parsers.robot_link",
        (  # not the ticks: watching those would leave a tenth of the inputs a second
            "lockstep.robot_bridge.control.event_core",
            "lockstep.robot_bridge.link.link_server",
            "lockstep.robot_bridge.link.link_session",
            "lockstep.robot_bridge.link.link_transport",
            "lockstep.robot_bridge.link.sending",
            "lockstep.protocol",
        ),
    ),
    "sdp": Target(
        "tests.fuzz.parsers.sdp",
        ("lockstep.server.webrtc.sdp_offer", "lockstep.server.routes.webrtc.whep", "aiortc.sdp"),
    ),
    "rtc_dtls": Target("tests.fuzz.parsers.rtc_dtls", ("lockstep.rtc.dtls",)),
    "rtc_sdp": Target("tests.fuzz.parsers.rtc_sdp", ("lockstep.rtc.sdp",)),
    "ice": Target("tests.fuzz.parsers.ice", ("lockstep.rtc.stun", "lockstep.rtc.ice", "lockstep.rtc.demux")),
    "sctp": Target("tests.fuzz.parsers.sctp", ("lockstep.rtc.sctp", "lockstep.rtc.channels", "lockstep.rtc.dcep")),
    "rtc_rtp": Target("tests.fuzz.parsers.rtc_rtp", ("lockstep.rtc.rtp",)),
    "channels": Target(
        "tests.fuzz.parsers.channels",
        ("lockstep.server.peers.channels", "lockstep.server.routes.scene_proxy", "lockstep.protocol"),
    ),
}


def corpus(target: str) -> dict[str, bytes]:
    """By file name."""
    return {path.name: path.read_bytes() for path in sorted((CORPUS / target).iterdir())}
