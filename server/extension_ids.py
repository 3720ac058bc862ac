"""The ids of RTP header extensions in an offer (RFC 8285 5 and 6): only those that fit a packet are left. No I/O.

An id is 1 to 255; 0 is padding. An offer may have 4096 to 4351 where it leaves the choice to the answer, which then has
another one. All other ids cannot be carried, and their extensions are left out.
"""

import re
from collections.abc import Iterable, Iterator, Sequence

from server.errors import BadSdp
from server.media.header_extensions import LARGEST_ID

__all__ = ["with_usable_ids"]

TO_BE_CHOSEN = range(4096, 4352)
RESERVED_ID = 15  # in the one-byte form: never chosen here, and left as it is where the offer has it
EXTMAP = re.compile(r"a=extmap:([0-9]{1,9})(/[a-z]+)? +(\S+)(.*)")


def with_usable_ids(lines: Sequence[str]) -> list[str]:
    """The lines of an offer, each extension with an id that fits a packet, or without it.

    What a mapping says besides id, direction and URI is left out: no extension of ours has any, and aiortc reads none.

    An extension has the same chosen id in every media section, as in one bundle it has to (RFC 9143 9.2).

    Raises:
        BadSdp: a mapping that is none.
    """
    mappings = {line: _mapping(line) for line in lines if line.startswith("a=extmap:")}
    free = _free({number for number, _ in mappings.values()})
    chosen: dict[str, int] = {}  # by URI
    kept = []
    for line in lines:
        if line in mappings:
            number, uri = mappings[line]
            if number in TO_BE_CHOSEN and uri not in chosen:
                chosen[uri] = next(free, 0)
            line = _with_id(line, chosen[uri] if number in TO_BE_CHOSEN else number)
        if line:
            kept.append(line)
    return kept


def _mapping(line: str) -> tuple[int, str]:
    """The id and the URI."""
    found = EXTMAP.fullmatch(line.rstrip())
    if found is None:
        raise BadSdp("a header extension without an id and a URI (RFC 8285 8)")
    return int(found[1]), found[3]


def _free(taken: Iterable[int]) -> Iterator[int]:
    """Those that the offer has nowhere; the first ones fit the one-byte form."""
    used = {*taken, RESERVED_ID}
    return (number for number in range(1, LARGEST_ID + 1) if number not in used)


def _with_id(line: str, number: int) -> str:
    """The line with another id; "" when it is none that can be carried."""
    if not 1 <= number <= LARGEST_ID:
        return ""
    return EXTMAP.sub(lambda found: f"a=extmap:{number}{found[2] or ''} {found[3]}", line.rstrip())
