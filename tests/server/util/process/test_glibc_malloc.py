"""Each in a process of its own: a heap is what the process before made of it."""

import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="glibc")

GIVEN_BACK = """
import os
from pathlib import Path
from lockstep.server.util.process.glibc_malloc import give_back

def resident():
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

blocks = [bytes(4000) for _ in range(20_000)]
kept = blocks[::16]
del blocks
before = resident()
give_back()
print(before - resident())
"""

ARENAS = """
import ctypes, sys, threading
from lockstep.server.util.process.glibc_malloc import share_arenas
if sys.argv[1] == "shared":
    share_arenas()
all_there, libc = threading.Barrier(9), ctypes.CDLL(None)
libc.fdopen.restype = ctypes.c_void_p
libc.malloc.restype = ctypes.c_void_p

def work():
    libc.malloc(ctypes.c_size_t(5000))
    all_there.wait()
    all_there.wait()

threads = [threading.Thread(target=work) for _ in range(8)]
for thread in threads:
    thread.start()
all_there.wait()
out = ctypes.c_void_p(libc.fdopen(1, b"w"))
libc.malloc_info(0, out)
libc.fflush(out)
all_there.wait()
"""


def said(program: str, *arguments: str) -> str:
    done = subprocess.run([sys.executable, "-c", program, *arguments], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_what_lies_between_blocks_in_use_goes_back_to_the_system() -> None:
    assert int(said(GIVEN_BACK)) > 40_000_000


def test_eight_threads_share_two_arenas_that_would_have_one_each() -> None:
    assert said(ARENAS, "own").count("<heap nr=") >= 4
    assert said(ARENAS, "shared").count("<heap nr=") == 2
