"""The stage that encodes a stream in a thread: its queue decides what comes next, its encoder does the work."""

import asyncio
import logging
from collections.abc import Sequence
from functools import partial
from typing import Generic, NamedTuple, Protocol, TypeVar

from lockstep.robot_bridge.encoding.encoder_thread import EncoderThread
from lockstep.server.media.encoding.stream_encodings import StreamEncodings
from lockstep.server.media.encoding.tier_encoding import TierEncoding
from lockstep.server.media.errors import MediaError, PayloadError
from lockstep.server.media.metrics import DropCounter
from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.media.pipeline.stage import FrameStage, SourceFrame
from lockstep.server.util.cooperative_scheduler import CooperativeScheduler, turns_of_loop

__all__ = ["Encoded", "Encoder", "EncoderWorker", "JobQueue"]

logger = logging.getLogger(__name__)

Job = TypeVar("Job")
NewJob = TypeVar("NewJob", covariant=True)
DoneJob = TypeVar("DoneJob", contravariant=True)


class Encoded(NamedTuple):
    """The encoder's result for one encoding."""

    encoding: TierEncoding
    frames: Sequence[EncodedFrame]
    seconds: float = 0.0
    error: MediaError | None = None
    moves: bool = False  # True if peers may move between the encodings of this codec now, after `frames`


class JobQueue(Protocol[NewJob]):
    """Keeps frames for the encoder: bounded, on the event loop, without I/O."""

    def put(self, frame: SourceFrame) -> None: ...

    def next_job(self) -> NewJob | None:
        """Return the next job, decided now; None when there is none."""


class Encoder(Protocol[DoneJob]):
    """Decodes, encodes and packetises; runs in the worker's thread alone."""

    def encode(self, job: DoneJob) -> Sequence[Encoded]:
        """Do a job. Errors of media come back as results."""


class EncoderWorker(FrameStage, Generic[Job]):
    """Takes source frames into its queue, has them encoded one after the other, and passes encoded frames on."""

    def __init__(
        self,
        following: FrameStage,
        queue: JobQueue[Job],
        encoder: Encoder[Job],
        encodings: StreamEncodings,
        dropped: DropCounter,
    ) -> None:
        super().__init__(following)
        self.encoder = encoder
        self._queue = queue
        self._encodings = encodings
        self._dropped = dropped
        self._turns: CooperativeScheduler | None = None  # None: not running
        self._thread: EncoderThread | None = None  # None: not running
        self._is_busy = False  # True while the thread has a job
        self._has_failed = False  # True after the first failure of the encoder

    def source(self, frame: SourceFrame) -> None:
        self._queue.put(frame)
        self._begin_next()

    async def run(self) -> None:
        """Encode until cancelled."""
        thread = EncoderThread(f"media-{self._encodings.stream}")
        self._turns, self._thread = turns_of_loop(), thread
        try:
            self._begin_next()
            await asyncio.get_running_loop().create_future()
        finally:
            self._turns = self._thread = None
            await thread.close()

    def _begin_next(self) -> None:
        """Give the thread its next job, unless it is busy."""
        if self._thread is None or self._turns is None or self._is_busy:
            return
        if (job := self._queue.next_job()) is not None:
            failure = self._thread.submit(self._work, job, self._turns)
            if failure is None:
                self._is_busy = True
            else:
                self._failed(failure)
                self._request_passed()  # the pictures that were to be decoded for this job are missing to the next ones

    def _work(self, job: Job, turns: CooperativeScheduler) -> None:
        """Do a job in the thread. Its results go out at once, without waiting for a task's turn."""
        try:
            tell = partial(self._worked, self.encoder.encode(job))
        except Exception as error:  # unexpected error of a codec library; the stream must go on
            tell = partial(self._worked, (), error)
        turns.call_from_thread(tell)

    def _worked(self, results: Sequence[Encoded], error: Exception | None = None) -> None:
        self._is_busy = False
        if self._turns is None:  # ended meanwhile
            return
        try:
            if error is not None:
                self._failed(error)
            for result in results:
                self._finish(result)
        finally:
            self._begin_next()

    def _failed(self, error: Exception) -> None:
        if not self._has_failed:
            text = "stream %s: the worker failed; further failures are only counted"
            logger.error(text, self._encodings.stream, exc_info=error)
        self._has_failed = True
        self._dropped.count("worker_failed")
        for encoding in self._encodings:
            encoding.keyframes.request()

    def _finish(self, result: Encoded) -> None:
        if result.error is not None:
            self._dropped.count(result.error.name)
            result.encoding.keyframes.request()  # it may have been a keyframe that somebody waits for
            if isinstance(result.error, PayloadError):
                # The robot's next pictures build on one that could not be decoded. The operator's come first.
                self._request_passed(other=all(map(self._encodings.is_other, result.encoding.targets)))
        else:
            result.encoding.encode_seconds.observe(result.seconds)
        for frame in result.frames:
            self.following.encoded(frame, result.encoding)
        if result.moves:
            self._encodings.own.move_all(result.encoding.codec)

    def _request_passed(self, *, other: bool = False) -> None:
        """Request a keyframe of a robot that encodes. `other`: for others than the operator alone."""
        if self._encodings.passed is not None:
            self._encodings.passed.request_keyframe("drop", other=other)
