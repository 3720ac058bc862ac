"""Watches the episodes that pass the writing thread: one that is not whole in one file is not kept. No I/O."""

from lockstep.server.recording.format.records import EpisodeRecord

__all__ = ["WholeEpisodes"]


class WholeEpisodes:
    """Show it each record before it is written.

    Attributes:
        open: id of the episode whose begin is in the present file and whose end is not; "" for none
        cut: id of the episode that the end of an earlier file has cut and that has not ended since; "" for none
        begun: there was any record
    """

    def __init__(self) -> None:
        self.open = ""
        self.cut = ""
        self.begun = False

    def takes(self, record: EpisodeRecord) -> bool:
        """True if the record belongs into the present file. Else its episode began in another one."""
        self.leaves_out(record)
        if record.kind == "start":
            self.open, self.cut = record.episode, ""
            return True
        is_here = self.open == record.episode
        if is_here and record.kind != "mark":
            self.open = ""
        return is_here

    def leaves_out(self, record: EpisodeRecord) -> None:
        """Take a record that belongs into no file."""
        self.begun = True
        if self.cut == record.episode and record.kind != "mark":
            self.cut = ""

    def file_ends(self) -> str:
        """Return the id of the episode that the end of the file cuts; "" for none."""
        cut, self.open = self.open, ""
        self.cut = cut or self.cut
        return cut
