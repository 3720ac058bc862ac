"""The SDK's server in a process of its own, so that the test's process keeps its priorities."""

import subprocess
import sys

import pytest

SHOWS = """
from pathlib import Path
import os
from lockstep.server.foxglove.sdk_server import NICE, SdkServer
server = SdkServer("127.0.0.1", 0)
own = [int(task.name) for task in Path("/proc/self/task").glob("*")]
theirs = [each for each in own if Path(f"/proc/self/task/{each}/comm").read_text().startswith("tokio")]
assert theirs, "the SDK's threads have other names now"
before = os.getpriority(os.PRIO_PROCESS, os.getpid())
assert {os.getpriority(os.PRIO_PROCESS, each) for each in theirs} == {NICE}
assert {os.getpriority(os.PRIO_PROCESS, each) for each in set(own) - set(theirs)} == {before}
server.stop()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has a priority for each thread")
def test_the_threads_of_the_sdk_yield_to_the_consoles() -> None:
    subprocess.run([sys.executable, "-c", SHOWS], check=True, timeout=60)
