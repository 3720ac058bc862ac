"""Tunes the C library's heap. Every function does nothing where the library is not glibc."""

import ctypes

__all__ = ["give_back", "share_arenas"]

M_ARENA_MAX = -8  # mallopt(3)
ARENAS = 2  # one for the loop, one for all encoders


def share_arenas() -> None:
    """Let all threads share two arenas (mallopt(3)). Call before there are threads.

    By default glibc gives each thread its own. An encoder takes ten megabytes and opens on any free thread, so encoders
    that come and go with the network would leave such a hole in the arena of every thread in turn.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(M_ARENA_MAX, ARENAS)


def give_back() -> None:
    """Return free memory between blocks in use to the system (malloc_trim(3)): by default glibc keeps it."""
    malloc_trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if malloc_trim is not None:
        malloc_trim(0)
