"""Reads the size of a JPEG picture from its header alone (ITU-T T.81, annex B)."""

__all__ = ["jpeg_size"]

START_OF_IMAGE = b"\xff\xd8"
START_OF_FRAME = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}  # B.1.1.3: SOFn, without DHT, JPG and DAC
ALONE = {0x01, *range(0xD0, 0xD8)}  # TEM and RSTn have no length


def jpeg_size(data: bytes) -> tuple[int, int] | None:
    """Return width and height; None if `data` is not a JPEG."""
    if not data.startswith(START_OF_IMAGE):
        return None
    at = 2
    while at + 4 <= len(data):
        if data[at] != 0xFF:
            return None
        marker = data[at + 1]
        if marker == 0xFF:  # B.1.1.2: fill bytes
            at += 1
        elif marker in ALONE:
            at += 2
        elif marker in START_OF_FRAME:
            if at + 9 > len(data):
                return None
            return int.from_bytes(data[at + 7 : at + 9], "big"), int.from_bytes(data[at + 5 : at + 7], "big")
        else:
            length = int.from_bytes(data[at + 2 : at + 4], "big")
            if length < 2:
                return None
            at += 2 + length
    return None
