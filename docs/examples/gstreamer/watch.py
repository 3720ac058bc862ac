"""Watch a robot with GStreamer: python3 docs/examples/gstreamer/watch.py LINK

It shows the first camera and prints the event of each picture, its gap, and whether it was shown. The rule is the
page's: a picture is shown while it is at most `--tolerance` events away from the newest feedback.

Debian packages: python3-gi gir1.2-gst-plugins-bad-1.0 gstreamer1.0-plugins-good gstreamer1.0-plugins-bad
gstreamer1.0-nice gstreamer1.0-x
"""

import argparse
import json
import os
import signal
import sys
import urllib.error
import urllib.request
from collections.abc import Callable
from typing import Any

import gi

gi.require_version("Gst", "1.0")
gi.require_version("GstSdp", "1.0")
gi.require_version("GstWebRTC", "1.0")
from gi.repository import GLib, Gst, GstSdp, GstWebRTC  # noqa: E402  after the versions were chosen

EVENT_REFERENCE = "urn:x-lockstep:rtp-hdrext:event-reference"
EXTENSION_ID = 1  # of the event reference, in this offer
VP8 = "application/x-rtp,media=video,encoding-name=VP8,clock-rate=90000,payload=96,extmap-{}={}"
RECEIVE = "rtpvp8depay name=depay wait-for-keyframe=true request-keyframe=true ! appsink name=frames sync=false"
SHOW = (
    "appsrc name=frames format=time caps=video/x-vp8 ! vp8dec name=decoder ! videoconvert ! textoverlay name=event "
    "valignment=bottom halignment=left ! videoconvert ! {} name=screen sync=false"
)
SCREEN = "autovideosink" if {"DISPLAY", "WAYLAND_DISPLAY"} & set(os.environ) else "fakesink"
PING_SECONDS = 2  # a client that opened data channels and says nothing is taken for gone after 20 s
REPAIR_MS = 100  # how long the jitter buffer waits for a lost packet to be sent again
MAX_EVENT = 2**31 - 1

Picture = tuple[int, int, bool]  # event, gap, shown


def event_of(packet: bytes) -> int | None:
    """The event reference of an RTP packet (RFC 3550 5.1, RFC 8285); None when it has none."""
    start = 12 + 4 * (packet[0] & 0x0F)
    if not packet[0] & 0x10 or packet[start : start + 2] != b"\xbe\xde":
        return None
    end = start + 4 + 4 * int.from_bytes(packet[start + 2 : start + 4], "big")
    position = start + 4
    while position < end:
        number, size = packet[position] >> 4, (packet[position] & 0x0F) + 1
        if number == EXTENSION_ID:
            return int.from_bytes(packet[position + 1 : position + 1 + size], "big")
        position += 1 + size if number else 1  # a zero is padding
    return None


def gap_of(feedback: int, stamp: int) -> int:
    """How many events the robot is ahead of the picture; the numbers begin again after 2^31 - 1."""
    half = MAX_EVENT // 2
    return (feedback - stamp + half) % MAX_EVENT - half


class Watcher:
    """One session. `on_picture` is called, in a thread of GStreamer, for each picture that was decoded.

    `peer` is the WebRTC connection; `screen` decodes the pictures and shows those that may be shown.
    """

    def __init__(self, link: str, tolerance: int, screen: str, on_picture: Callable[[Picture], None]) -> None:
        self.failed = ""
        self._url, _, self._token = link.partition("/#token=")
        self._tolerance = tolerance
        self._on_picture = on_picture
        self._feedback: int | None = None  # the newest feedback's event
        self._stamp: int | None = None  # of the packet that the depayloader has now
        self._stamps: dict[int, int] = {}  # of the frames that are being decoded, by their number
        self._frames = 0
        self._resource = ""  # what DELETE ends the session with
        self._loop = GLib.MainLoop()
        self._receiver = Gst.Pipeline.new()
        self.peer = Gst.ElementFactory.make("webrtcbin")
        self.peer.set_property("bundle-policy", GstWebRTC.WebRTCBundlePolicy.MAX_BUNDLE)
        self.peer.set_property("latency", REPAIR_MS)
        self._receiver.add(self.peer)
        self.screen = Gst.parse_launch(SHOW.format(screen))
        self._overlay = self.screen.get_by_name("event")
        decoded = self.screen.get_by_name("decoder").get_static_pad("src")
        decoded.add_probe(Gst.PadProbeType.BUFFER, self._gate)
        for pipeline in (self._receiver, self.screen):
            bus = pipeline.get_bus()
            bus.add_signal_watch()
            bus.connect("message::error", lambda _bus, message: self.stop(message.parse_error()[0].message))

    def run(self) -> None:
        """Until `stop`. Then `failed` says why, unless it was asked for."""
        self.peer.connect("pad-added", self._on_pad)
        self.peer.connect("notify::connection-state", self._on_connection)
        self._receiver.set_state(Gst.State.READY)
        caps = Gst.Caps.from_string(VP8.format(EXTENSION_ID, EVENT_REFERENCE))
        self.peer.emit("add-transceiver", GstWebRTC.WebRTCRTPTransceiverDirection.RECVONLY, caps)
        options = Gst.Structure.from_string("options,ordered=(boolean)false,max-retransmits=(int)0")[0]
        self._control = self.peer.emit("create-data-channel", "control", options)
        self._control.connect("on-message-string", self._on_message)
        self._receiver.set_state(Gst.State.PLAYING)
        self.peer.emit("create-offer", None, Gst.Promise.new_with_change_func(self._on_offer))
        GLib.timeout_add_seconds(PING_SECONDS, self._ping)
        self._loop.run()
        self._receiver.set_state(Gst.State.NULL)
        self.screen.set_state(Gst.State.NULL)
        if self._resource:
            self._request("DELETE", self._resource)

    def stop(self, why: str = "") -> None:
        self.failed = self.failed or why
        GLib.idle_add(self._loop.quit)

    def _on_offer(self, promise: Gst.Promise) -> None:
        """The offer needs no candidates: the console learns where this is from the checks that come."""
        reply = promise.get_reply()  # the offer lives as long as this
        offer = reply.get_value("offer")
        text = offer.sdp.as_text()
        self._describe("set-local-description", offer)
        GLib.idle_add(self._post, text.encode())  # not in this thread, which is the connection's own

    def _post(self, offer: bytes) -> None:
        try:
            answer, self._resource = self._request("POST", "/whep", offer)
        except urllib.error.HTTPError as error:
            self.stop(f"{error.code}: {error.read().decode()}")
        except OSError as error:
            self.stop(f"no console at {self._url}: {error}")
        else:
            parsed = GstSdp.SDPMessage.new_from_text(answer)[1]
            described = GstWebRTC.WebRTCSessionDescription.new(GstWebRTC.WebRTCSDPType.ANSWER, parsed)
            self._describe("set-remote-description", described)

    def _describe(self, signal: str, description: GstWebRTC.WebRTCSessionDescription) -> None:
        promise = Gst.Promise.new()
        self.peer.emit(signal, description, promise)
        promise.interrupt()  # nobody waits for it

    def _request(self, method: str, path: str, body: bytes | None = None) -> tuple[str, str]:
        """The body, and the Location that came with it. Raises OSError, HTTPError among them."""
        headers = {"Authorization": f"Bearer {self._token}", "Content-Type": "application/sdp"}
        request = urllib.request.Request(self._url + path, body, headers, method=method)
        with urllib.request.urlopen(request, timeout=15) as response:
            return response.read().decode(), response.headers.get("Location", "")

    def _on_connection(self, peer: Gst.Element, _property: Any) -> None:
        state = peer.get_property("connection-state")
        if state in (GstWebRTC.WebRTCPeerConnectionState.FAILED, GstWebRTC.WebRTCPeerConnectionState.CLOSED):
            self.stop(f"the connection is {state.value_nick}")

    def _ping(self) -> bool:
        if self._control.get_property("ready-state") == GstWebRTC.WebRTCDataChannelState.OPEN:
            self._control.emit("send-string", json.dumps({"type": "ping", "id": self._frames}))
        return True

    def _on_message(self, _channel: Any, text: str) -> None:
        message = json.loads(text)
        if message["type"] == "feedback":
            self._feedback = message["event"]

    def _on_pad(self, peer: Gst.Element, pad: Gst.Pad) -> None:
        """Media comes. Packets are looked at before the depayloader, in the thread that then takes the frame."""
        if pad.get_direction() != Gst.PadDirection.SRC:
            return
        self.screen.set_state(Gst.State.PLAYING)
        receiving = Gst.parse_bin_from_description(RECEIVE, True)
        self._receiver.add(receiving)
        depay = receiving.get_by_name("depay").get_static_pad("sink")
        depay.add_probe(Gst.PadProbeType.BUFFER, self._on_packet)
        frames = receiving.get_by_name("frames")
        frames.set_property("emit-signals", True)
        frames.connect("new-sample", self._on_frame)
        receiving.sync_state_with_parent()
        pad.link(receiving.get_static_pad("sink"))

    def _on_packet(self, _pad: Gst.Pad, info: Gst.PadProbeInfo) -> Gst.PadProbeReturn:
        packet = info.get_buffer()
        self._stamp = event_of(packet.extract_dup(0, packet.get_size()))
        return Gst.PadProbeReturn.OK

    def _on_frame(self, sink: Gst.Element) -> Gst.FlowReturn:
        """One whole encoded picture. It goes to the decoder with its number for a time, by which it is found again:
        the times of received packets are corrected on the way, so they name no picture."""
        frame = sink.emit("pull-sample").get_buffer()
        if self._stamp is None:
            return Gst.FlowReturn.OK  # nobody knows which event it shows
        self._stamps[self._frames] = self._stamp
        copy = Gst.Buffer.new_wrapped(frame.extract_dup(0, frame.get_size()))
        copy.pts = self._frames * Gst.MSECOND
        self._frames += 1
        self.screen.get_by_name("frames").emit("push-buffer", copy)
        return Gst.FlowReturn.OK

    def _gate(self, _pad: Gst.Pad, info: Gst.PadProbeInfo) -> Gst.PadProbeReturn:
        """Decides about a decoded picture at the moment at which it would be shown."""
        number = info.get_buffer().pts // Gst.MSECOND
        stamp = self._stamps[number]
        self._stamps = {each: event for each, event in self._stamps.items() if each > number}
        if self._feedback is None:
            return Gst.PadProbeReturn.DROP
        gap = gap_of(self._feedback, stamp)
        shown = abs(gap) <= self._tolerance  # one that is ahead of the feedback could be kept until that has come
        self._overlay.set_property("text", f"event {stamp}")
        self._on_picture((stamp, gap, shown))
        return Gst.PadProbeReturn.OK if shown else Gst.PadProbeReturn.DROP


def main() -> None:
    parser = argparse.ArgumentParser(description="Watch a robot with GStreamer.")
    parser.add_argument("link", help="as lockstep up prints it")
    parser.add_argument("--tolerance", type=int, default=4, help="the largest gap that is shown, in events")
    parser.add_argument("--screen", default=SCREEN, help=f"the element that shows them, here {SCREEN}")
    chosen = parser.parse_args()

    def tell(picture: Picture) -> None:
        event, gap, shown = picture
        print(f"event {event}, gap {gap}, {'shown' if shown else 'left out'}", flush=True)

    Gst.init(None)
    watcher = Watcher(chosen.link, chosen.tolerance, chosen.screen, tell)
    for each in (signal.SIGINT, signal.SIGTERM):
        GLib.unix_signal_add(GLib.PRIORITY_DEFAULT, each, watcher.stop)
    watcher.run()
    if watcher.failed:
        sys.exit(watcher.failed)


if __name__ == "__main__":
    main()
