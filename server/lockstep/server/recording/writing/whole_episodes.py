"""Watches the episodes that pass the writing thread: one that is not whole in one file is not kept. No I/O."""

from lockstep.server.recording.format.records import EpisodeRecord

__all__ = ["WholeEpisodes"]


class WholeEpisodes:
    """Show it each record before it is written.

    Attributes:
        open: id of the episode whose begin is in the present file and whose end is not; "" for none
    """

    def __init__(self) -> None:
        self.open = ""

    def takes(self, record: EpisodeRecord) -> bool:
        """True if the record belongs into the present file. Else its episode began in another one."""
        if record.kind == "start":
            self.open = record.episode
            return True
        is_here = self.open == record.episode
        if is_here and record.kind != "mark":
            self.open = ""
        return is_here

    def file_ends(self) -> str:
        """Return the id of the episode that the end of the file cuts; "" for none."""
        cut, self.open = self.open, ""
        return cut
