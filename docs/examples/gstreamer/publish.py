"""Publish a camera to a console with GStreamer, by WHIP (RFC 9725): python3 publish.py LINK [--camera NAME]

Written against GStreamer 1.22 (Debian 12). Packages: python3-gi gir1.2-gst-plugins-bad-1.0 gstreamer1.0-nice
gstreamer1.0-plugins-base gstreamer1.0-plugins-good gstreamer1.0-plugins-bad

The console has to know the camera: `lockstep up --whip phone`. LINK is an operator's, as `lockstep up` prints it.
"""

import argparse
import signal
import sys
import urllib.error
import urllib.parse
import urllib.request

import gi

gi.require_version("Gst", "1.0")
gi.require_version("GstSdp", "1.0")
gi.require_version("GstWebRTC", "1.0")
from gi.repository import GLib, Gst, GstSdp, GstWebRTC  # noqa: E402  after the versions

CAMERA = "v4l2src ! videoconvert"
# No pictures that build on later ones, a keyframe when one is asked for, parameter sets with each.
ENCODE = {
    "H264": "openh264enc complexity=low bitrate=1500000 gop-size=0 ! h264parse config-interval=-1 ! rtph264pay pt=96",
    "VP8": "vp8enc deadline=1 cpu-used=8 target-bitrate=1500000 keyframe-max-dist=2000 ! rtpvp8pay pt=96",
}
CAPS = "application/x-rtp,media=video,encoding-name={},payload=96,clock-rate=90000"


class Publisher:
    """One WHIP session. `failed` says why it ended, unless that was asked for."""

    def __init__(self, link: str, camera: str, source: str, codec: str) -> None:
        self.failed = ""
        self._url, _, self._token = link.partition("/#token=")
        self._path = f"/whip?camera={urllib.parse.quote(camera)}"
        self._session = ""  # what DELETE ends it with
        self._loop = GLib.MainLoop()
        encode = f"{source} ! video/x-raw,format=I420 ! {ENCODE[codec]} ! {CAPS.format(codec)}"
        self._pipeline = Gst.parse_launch(f"{encode} ! webrtcbin name=peer bundle-policy=max-bundle")
        self._peer = self._pipeline.get_by_name("peer")
        section = self._peer.emit("get-transceiver", 0)
        section.set_property("direction", GstWebRTC.WebRTCRTPTransceiverDirection.SENDONLY)
        section.set_property("do-nack", True)
        bus = self._pipeline.get_bus()
        bus.add_signal_watch()
        bus.connect("message::error", lambda _bus, message: self.stop(message.parse_error()[0].message))

    def run(self) -> None:
        """Until `stop`."""
        self._peer.connect("notify::connection-state", self._on_connection)
        self._peer.connect("on-negotiation-needed", self._on_negotiation)
        self._pipeline.set_state(Gst.State.PLAYING)
        self._loop.run()
        self._pipeline.set_state(Gst.State.NULL)
        if self._session:
            self._request("DELETE", self._session)

    def stop(self, why: str = "") -> None:
        self.failed = self.failed or why
        GLib.idle_add(self._loop.quit)

    def _on_negotiation(self, peer: Gst.Element) -> None:
        if not self._session:
            peer.emit("create-offer", None, Gst.Promise.new_with_change_func(self._on_offer))

    def _on_offer(self, promise: Gst.Promise) -> None:
        """The offer needs no candidates: the console learns where this is from the checks that come."""
        reply = promise.get_reply()  # the offer lives as long as this
        offer = reply.get_value("offer")
        text = offer.sdp.as_text()
        self._describe("set-local-description", offer)
        GLib.idle_add(self._post, text.encode())  # not in this thread, which is the connection's own

    def _post(self, offer: bytes) -> None:
        try:
            answer, self._session = self._request("POST", self._path, offer)
        except urllib.error.HTTPError as error:
            self.stop(f"{error.code}: {error.read().decode()}")
        except OSError as error:
            self.stop(f"no console at {self._url}: {error}")
        else:
            parsed = GstSdp.SDPMessage.new_from_text(answer)[1]
            described = GstWebRTC.WebRTCSessionDescription.new(GstWebRTC.WebRTCSDPType.ANSWER, parsed)
            self._describe("set-remote-description", described)
            print(f"publishing to {self._url}", flush=True)

    def _describe(self, signal: str, description: GstWebRTC.WebRTCSessionDescription) -> None:
        promise = Gst.Promise.new()
        self._peer.emit(signal, description, promise)
        promise.interrupt()  # nobody waits for it

    def _request(self, method: str, path: str, body: bytes | None = None) -> tuple[str, str]:
        """The body, and the Location that came with it. Raises OSError, HTTPError among them."""
        headers = {"Authorization": f"Bearer {self._token}", "Content-Type": "application/sdp"}
        request = urllib.request.Request(self._url + path, body, headers, method=method)
        with urllib.request.urlopen(request, timeout=15) as response:
            return response.read().decode(), response.headers.get("Location", "")

    def _on_connection(self, peer: Gst.Element, _property: object) -> None:
        state = peer.get_property("connection-state")
        if state in (GstWebRTC.WebRTCPeerConnectionState.FAILED, GstWebRTC.WebRTCPeerConnectionState.CLOSED):
            self.stop(f"the connection is {state.value_nick}")


def main() -> None:
    parser = argparse.ArgumentParser(description="Publish a camera with GStreamer.")
    parser.add_argument("link", help="an operator's, as lockstep up prints it")
    parser.add_argument("--camera", default="", help="its name at the console; unset: the first that nobody publishes")
    parser.add_argument("--source", default=CAMERA, help=f"where pictures come from; unset: {CAMERA}")
    parser.add_argument("--codec", choices=sorted(ENCODE), default="VP8")
    chosen = parser.parse_args()
    Gst.init(None)
    publisher = Publisher(chosen.link, chosen.camera, chosen.source, chosen.codec)
    for each in (signal.SIGINT, signal.SIGTERM):
        GLib.unix_signal_add(GLib.PRIORITY_DEFAULT, each, publisher.stop)
    publisher.run()
    if publisher.failed:
        sys.exit(publisher.failed)


if __name__ == "__main__":
    main()
