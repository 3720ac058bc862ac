"""The SDK's server in a process of its own, so that the test's process keeps its priorities."""

import subprocess
import sys

import pytest

SHOWS = """
from pathlib import Path
import os, time
from lockstep.server.foxglove.sdk_server import NICE, SdkServer
server = SdkServer("127.0.0.1", 0)

def threads():
    own = [int(task.name) for task in Path("/proc/self/task").glob("*")]
    return own, [each for each in own if Path(f"/proc/self/task/{each}/comm").read_text().startswith("tokio")]

own, theirs = threads()
while len(theirs) < min(2, os.cpu_count()):  # a new thread has the name of the one that made it until it runs
    time.sleep(0.01)
    own, theirs = threads()
server.yield_to_the_operator()
before = os.getpriority(os.PRIO_PROCESS, os.getpid())
assert {os.getpriority(os.PRIO_PROCESS, each) for each in theirs} == {NICE}
assert {os.getpriority(os.PRIO_PROCESS, each) for each in set(own) - set(theirs)} == {before}
server.stop()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has a priority for each thread")
def test_the_threads_of_the_sdk_yield_to_the_consoles() -> None:
    subprocess.run([sys.executable, "-c", SHOWS], check=True, timeout=60)
