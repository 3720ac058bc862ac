"""Fuzzing guided by coverage, with atheris (libFuzzer): finds what no mutation of the corpus would hit by chance."""

import sys
from pathlib import Path

import atheris

from tests.fuzz.targets import CORPUS, TARGETS

__all__ = ["fuzz"]

MAX_LENGTH = 16_384


def fuzz(target: str, seconds: int, found: Path) -> int:
    """Does not return: libFuzzer ends the process, with 0 when nothing was found."""
    chosen = TARGETS[target]
    with atheris.instrument_imports(include=list(chosen.instrumented)):
        attempt = chosen.load()
    arguments = [
        sys.argv[0],
        f"-max_total_time={seconds}",
        f"-max_len={MAX_LENGTH}",
        f"-artifact_prefix={found.parent / target}-",
        "-rss_limit_mb=1024",
        "-timeout=10",
        "-print_final_stats=1",
        str(found),
        str(CORPUS / target),
    ]
    atheris.Setup(arguments, attempt)
    atheris.Fuzz()
    return 0
