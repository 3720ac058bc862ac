"""Parses `--whip`: a camera of the console that a client publishes. No I/O.

`NAME[#option=value,option=value]`, as in `phone#label=Ann%27s%20phone,latency=0.4`.
"""

from collections.abc import Iterable

from lockstep.server.media.sources.source_url import NAME, BadSource, SourceSpec, parse_source

__all__ = ["SCHEME", "parse_published"]

SCHEME = "whip"
LATENCY = 0.3  # s from capture until the quickest picture leaves the publisher
MOST = 4  # cameras that clients may publish


def parse_published(texts: Iterable[str]) -> tuple[SourceSpec, ...]:
    """Parse the cameras that clients may publish; each has a different name.

    Raises:
        BadSource: one is not valid, or there are too many.
    """
    given = list(texts)
    if len(given) > MOST:
        raise BadSource(f"more than {MOST} cameras")
    found: list[SourceSpec] = []
    for text in given:
        name, _, options = text.strip().partition("#")
        if not NAME.fullmatch(name):
            raise BadSource(f"{name[:40]!r} is not a name: use a letter, then at most 31 letters, digits, - and _")
        if name in (each.name for each in found):
            raise BadSource(f"the name {name} is used twice")
        spec = parse_source("video", f"{name}={SCHEME}://publisher#latency={LATENCY}{',' if options else ''}{options}")
        found.append(spec._replace(passing=False))
    return tuple(found)
