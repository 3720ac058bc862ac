"""The limit of open files and sockets."""

import resource

__all__ = ["raise_file_limit"]

ENOUGH = 65_536


def raise_file_limit() -> None:
    """Raise the soft limit as far as the hard one allows, or to a value that is surely enough (getrlimit(2)).

    Each peer takes a socket for every address of this machine: the usual 1024 run out at a few hundred observers.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = ENOUGH if hard == resource.RLIM_INFINITY else min(ENOUGH, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
