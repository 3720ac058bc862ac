import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from lockstep.robot_bridge.thread_name import name_thread


@pytest.mark.skipif(sys.platform != "linux", reason="there is no /proc")
def test_a_thread_has_its_name_in_proc_cut_to_what_the_kernel_keeps() -> None:
    def look() -> str:
        return Path(f"/proc/self/task/{threading.get_native_id()}/comm").read_text().strip()

    before = look()
    with ThreadPoolExecutor(1, initializer=name_thread, initargs=("media-overview-camera",)) as pool:
        assert pool.submit(look).result() == "media-overview-"
    assert look() == before
