"""Words of another node, made fit to be shown. No I/O."""

__all__ = ["words_of"]

MOST = 200  # characters


def words_of(text: object, most: int = MOST) -> str:
    """Return one line of printable characters, cut to `most`."""
    line = " ".join(str(text).split())
    return "".join(filter(str.isprintable, line))[:most]
