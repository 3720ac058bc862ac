"""Fuzz a target for a while: `python -m tests.fuzz TARGET --seconds N`; `make fuzz` does all of them.

Begins with the corpus, and ends with another status than 0 on a finding. With atheris the mutations follow the code
that they reach; where it does not run, they are blind. Inputs that reach something new stay in `.fuzz/TARGET`; a
finding is written to `.fuzz/TARGET-…`: add it to the corpus.
"""

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

from tests.fuzz.mutation import mutations
from tests.fuzz.targets import TARGETS, corpus

STATE = Path(".fuzz")


def main() -> int:
    parser = argparse.ArgumentParser(description="Fuzz one target.")
    parser.add_argument("target", nargs="?", choices=sorted(TARGETS))
    parser.add_argument("--list", action="store_true", help="print the targets")
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--blind", action="store_true", help="without atheris")
    options = parser.parse_args()
    if options.list or options.target is None:
        print(" ".join(sorted(TARGETS)))
        return 0
    found = STATE / options.target
    found.mkdir(parents=True, exist_ok=True)
    if not options.blind and (guided := guided_fuzzer()) is not None:
        return guided(options.target, options.seconds, found)
    return fuzz_blindly(options.target, options.seconds)


def guided_fuzzer() -> Callable[[str, int, Path], int] | None:
    """The fuzzer that knows what is reached; None where atheris is not installed."""
    try:
        from tests.fuzz.guided import fuzz
    except ImportError:
        return None
    return fuzz


def fuzz_blindly(target: str, seconds: int) -> int:
    attempt = TARGETS[target].load()
    end, tried = time.monotonic() + seconds, 0
    for data in mutations(list(corpus(target).values()), seed=time.time_ns()):
        if time.monotonic() > end:
            break
        try:
            attempt(data)
        except Exception:
            (STATE / f"{target}-finding").write_bytes(data)
            raise
        tried += 1
    print(f"{target}: {tried} inputs, nothing found")
    return 0


if __name__ == "__main__":
    sys.exit(main())
