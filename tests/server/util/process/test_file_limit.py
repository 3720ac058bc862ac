import subprocess
import sys

PROGRAM = """
import resource
from lockstep.server.util.process.file_limit import raise_file_limit
resource.setrlimit(resource.RLIMIT_NOFILE, (128, {hard}))
raise_file_limit()
print(*resource.getrlimit(resource.RLIMIT_NOFILE))
"""


def limits_after(hard: int) -> list[int]:
    """Soft and hard limit of a process of its own that raised a soft limit of 128."""
    program = [sys.executable, "-c", PROGRAM.format(hard=hard)]
    done = subprocess.run(program, capture_output=True, text=True, timeout=60, check=True)
    return [int(word) for word in done.stdout.split()]


def test_the_console_may_open_as_many_files_as_it_is_allowed() -> None:
    assert limits_after(512) == [512, 512]
