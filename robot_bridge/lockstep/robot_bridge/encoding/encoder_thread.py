"""The thread in which a stream is encoded. It is started with the first job."""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVarTuple

from lockstep.robot_bridge.thread_name import name_thread

__all__ = ["EncoderThread"]

Arguments = TypeVarTuple("Arguments")


class EncoderThread:
    """Does jobs one after the other. Used on the event loop."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._executor = self._new_executor()

    def _new_executor(self) -> ThreadPoolExecutor:
        return ThreadPoolExecutor(1, thread_name_prefix=self._name, initializer=name_thread, initargs=(self._name,))

    def submit(self, work: Callable[[*Arguments], None], *arguments: *Arguments) -> Exception | None:
        """Give the thread a job.

        Returns:
            why the job will not be done: the system has no room for a thread. None: it will be done. The next job tries
            again to start the thread.
        """
        try:
            self._executor.submit(work, *arguments)
        except RuntimeError as error:
            # The executor keeps a job for which it could start no thread, and would do it before the next one.
            self._executor.shutdown(wait=False, cancel_futures=True)
            self._executor = self._new_executor()
            return error
        return None

    async def close(self) -> None:
        """Wait for the jobs that were given."""
        await asyncio.to_thread(self._executor.shutdown)
