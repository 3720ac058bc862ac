"""The MCAP metadata at the beginning of a recording. No I/O."""

from collections.abc import Mapping
from typing import Annotated, Literal

import msgspec

from lockstep.server.recording.errors import RecordingDamaged, shortened
from lockstep.server.recording.format.records import Whole

__all__ = ["METADATA_NAME", "RecordingInfo"]

METADATA_NAME = "lockstep"


Text = Annotated[str, msgspec.Meta(max_length=1000)]  # bounded: everybody's list shows it, whoever made the file


class RecordingInfo(msgspec.Struct, frozen=True, kw_only=True):
    """The metadata of a recording, the same in all its parts but for part, epoch, episodes and cut."""

    recording: Text  # common to all parts
    part: Whole = 1
    epoch: Text = ""
    robot: Text = ""  # the description's label
    name: Text = ""  # given by a person
    by: Text = ""  # person who started it; "" when it was the command line
    episodes: Literal["", "none", "begun"] = ""  # in the parts before this one; "": an earlier version, not known
    cut: Text = ""  # id of the episode that was open when the part began, and so is whole in no file

    def metadata(self) -> dict[str, str]:
        """Return the metadata, without the last two where they are empty: files of earlier versions are signed so."""
        fields = msgspec.structs.asdict(self)
        return {name: str(value) for name, value in fields.items() if value or name not in ("episodes", "cut")}

    @classmethod
    def parse(cls, metadata: Mapping[str, str]) -> "RecordingInfo":
        """Parse the metadata. Raises RecordingDamaged."""
        try:
            return _decoder.decode(msgspec.json.encode(metadata))
        except msgspec.ValidationError as error:
            raise RecordingDamaged(f"not a recording of Lockstep: {shortened(error)}") from error


_decoder = msgspec.json.Decoder(RecordingInfo, strict=False)  # recordings are read on threads
