"""The MCAP metadata at the beginning of a recording. No I/O."""

from collections.abc import Mapping
from typing import Annotated

import msgspec

from lockstep.server.recording.errors import RecordingDamaged

__all__ = ["METADATA_NAME", "RecordingInfo"]

METADATA_NAME = "lockstep"


Text = Annotated[str, msgspec.Meta(max_length=1000)]  # bounded: everybody's list shows it, whoever made the file


class RecordingInfo(msgspec.Struct, frozen=True, kw_only=True):
    """The metadata of a recording, the same in all its parts but for part and epoch."""

    recording: Text  # common to all parts
    part: int = 1
    epoch: Text = ""
    robot: Text = ""  # the description's label
    name: Text = ""  # given by a person
    by: Text = ""  # person who started it; "" when it was the command line

    def metadata(self) -> dict[str, str]:
        return {name: str(value) for name, value in msgspec.structs.asdict(self).items()}

    @classmethod
    def parse(cls, metadata: Mapping[str, str]) -> "RecordingInfo":
        """Parse the metadata. Raises RecordingDamaged."""
        try:
            return _decoder.decode(msgspec.json.encode(metadata))
        except msgspec.ValidationError as error:
            raise RecordingDamaged(f"not a recording of Lockstep: {error}") from error


_decoder = msgspec.json.Decoder(RecordingInfo, strict=False)  # recordings are read on threads
