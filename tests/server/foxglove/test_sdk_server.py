"""The SDK's server in a process of its own, so that the test's process keeps its priorities."""

import subprocess
import sys

import pytest

SHOWS = """
from contextlib import suppress
from pathlib import Path
import os, time
from lockstep.server.foxglove.sdk_server import NICE, SdkServer

def threads():
    return {int(task.name) for task in Path("/proc/self/task").glob("*")}

def names(of):
    found = set()
    for each in of:
        with suppress(OSError):  # it has ended
            found.add(Path(f"/proc/self/task/{each}/comm").read_text()[:5])
    return found

def priorities(of):
    found = set()
    for each in of:
        with suppress(ProcessLookupError):
            found.add(os.getpriority(os.PRIO_PROCESS, each))
    return found

before = threads()
server = SdkServer("127.0.0.1", 0)
theirs = threads() - before  # as many as this process may use processors
while names(theirs) != {"tokio"}:  # a new thread has the name of the one that made it until it runs
    time.sleep(0.01)
    theirs = threads() - before
server.yield_to_the_operator()
assert priorities(theirs) == {NICE}, priorities(theirs)
assert priorities(before) == {os.getpriority(os.PRIO_PROCESS, os.getpid())} != {NICE}
server.stop()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has a priority for each thread")
def test_the_threads_of_the_sdk_yield_to_the_consoles() -> None:
    subprocess.run([sys.executable, "-c", SHOWS], check=True, timeout=60)
