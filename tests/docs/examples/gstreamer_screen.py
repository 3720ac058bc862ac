"""What docs/examples/gstreamer/watch.py shows, as JSON lines: python3 gstreamer_screen.py LINK TOLERANCE

Runs in the system's Python, where GStreamer is: it imports nothing of the project, and needs no other package.
"""

import base64
import importlib.util
import json
import signal
import sys
from pathlib import Path
from typing import Any

EXAMPLE = Path(__file__).resolve().parents[3] / "docs" / "examples" / "gstreamer" / "watch.py"
SCREEN = "video/x-raw,format=GRAY8 ! appsink emit-signals=true"


def loaded() -> Any:
    specification = importlib.util.spec_from_file_location("watch", EXAMPLE)
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def tell(**what: object) -> None:
    print(json.dumps(what), flush=True)


def main(link: str, tolerance: int) -> None:
    watch = loaded()
    watch.Gst.init(None)
    newest: list[int] = []  # the event of the picture that is under way to the screen, in the same thread

    told: list[str] = []

    def judged(picture: tuple[int, int, bool]) -> None:
        event, gap, shown = picture
        newest[:] = [event]
        tell(event=event, gap=gap, shown=shown)

    def certificate() -> str:
        transport = watcher.peer.emit("get-transceiver", 0).get_property("receiver").get_property("transport")
        return str(transport.get_property("certificate"))

    def on_screen(sink: Any) -> Any:
        sample = sink.emit("pull-sample")
        size = sample.get_caps().get_structure(0)
        width, height = size.get_value("width"), size.get_value("height")
        buffer = sample.get_buffer()
        stride = buffer.get_size() // height
        band = buffer.extract_dup(0, stride * (height // 20))  # the event strip
        text = base64.b64encode(band).decode()
        if not told:
            told.append(certificate())
            tell(certificate=told[0])
        tell(event=newest[0], width=width, height=height, stride=stride, band=text)
        return watch.Gst.FlowReturn.OK

    watcher = watch.Watcher(link, tolerance, SCREEN, judged)
    watcher.screen.get_by_name("screen").connect("new-sample", on_screen)
    watch.GLib.unix_signal_add(watch.GLib.PRIORITY_DEFAULT, signal.SIGTERM, watcher.stop)
    watcher.run()
    tell(failed=watcher.failed)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
