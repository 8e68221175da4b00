# SPDX-License-Identifier: GPL-2.0-or-later
"""The places where machines are judged: in this process, in several of this computer, or by Dask's workers on many.

An engine gets a study and the numbers of candidates, and returns their indices and judgements in any order, each as it
completes. A judgement depends only on study and numbers, so no engine changes the result of a search.
"""

import os
import signal
import threading
from concurrent.futures import CancelledError, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context

from .._core import VERSION
from .candidate import judge

# Largest number of candidates per message to a worker: some seconds of work, so that sending costs little.
BATCH = 16


# Advice in the message of a run that its workers have left.
GOES_ON = "results are kept, run the same command to continue"


class EngineError(RuntimeError):
    """Workers that cannot be used: unreachable, gone, or of another version."""


class Serial:
    """This process."""

    workers = 1

    def each(self, study, candidates):
        """Yields indices and judgements, as they complete."""
        for place, values in enumerate(candidates):
            yield place, judge(study, values)

    def close(self):
        """Does nothing."""


class Processes:
    """Several processes of this computer."""

    def __init__(self, workers):
        self.workers = workers
        # A fresh interpreter each: threads of the core do not survive a fork.
        self._pool = ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_alone)

    def each(self, study, candidates):
        """Yields indices and judgements, as they complete."""
        pieces = list(batches(candidates, self.workers))
        try:
            with _uninterrupted():
                started = {self._pool.submit(judged, study, [values for _, values in piece]): piece for piece in pieces}
            for done in as_completed(started):
                yield from _placed(started[done], done.result())
        except BrokenProcessPool:
            raise EngineError(f"a worker process was killed, perhaps for lack of memory; {GOES_ON}") from None

    def close(self):
        """Ends the processes."""
        self._pool.shutdown(cancel_futures=True)


class Cluster:
    """The workers of a Dask scheduler: any number, which may join and leave while they work."""

    def __init__(self, address, timeout=30):
        from distributed import Client

        try:
            self._client = Client(address, timeout=timeout)
        except (OSError, TimeoutError, ValueError) as error:
            raise EngineError(f"{address}: no scheduler responds: {error}") from None
        self._address = address
        self._refuse_others()

    @property
    def workers(self):
        """Returns the present number of workers."""
        return max(1, len(self._client.scheduler_info(n_workers=-1)["workers"]))

    def _refuse_others(self):
        for worker, version in self._client.run(_version).items():
            if version != VERSION:
                raise EngineError(f"{worker} has pkmkins {version}, this computer {VERSION}: install the same version everywhere")

    def each(self, study, candidates):
        """Yields indices and judgements, as they complete; the unfinished ones of a worker that dies are repeated."""
        from distributed import as_completed

        started = {}
        for piece in batches(candidates, self.workers):
            # Dask would cache a repeated call: every run is separate.
            done = self._client.submit(judged, study, [values for _, values in piece], VERSION, pure=False, retries=10)
            started[done.key] = (done, piece)
        try:
            for done in as_completed([done for done, _ in started.values()]):
                yield from _placed(started[done.key][1], done.result())
        except (CancelledError, OSError):
            raise EngineError(f"{self._address}: the scheduler has disappeared; {GOES_ON}") from None

    def close(self):
        """Leaves the scheduler and its workers running."""
        self._client.close()


def batches(candidates, workers):
    """Returns candidates with their indices, in pieces that keep every worker busy to the end."""
    size = max(1, min(BATCH, len(candidates) // (4 * workers)))
    numbered = list(enumerate(candidates))
    return (numbered[start : start + size] for start in range(0, len(numbered), size))


def judged(study, candidates, version=VERSION):
    """Judges candidates in a worker."""
    if version != VERSION:
        raise EngineError(f"this worker has pkmkins {VERSION}, the study comes from {version}")
    return [judge(study, values) for values in candidates]


def _placed(piece, judgements):
    return [(place, judgement) for (place, _), judgement in zip(piece, judgements, strict=True)]


@contextmanager
def _uninterrupted():
    """Delays Ctrl-C, which a terminal sends to all processes, to the end; processes started here never get it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    asked = []
    handler = signal.signal(signal.SIGINT, lambda *_: asked.append(True))
    # A blocked signal stays blocked in processes that start; a handler would not.
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        signal.signal(signal.SIGINT, handler)
    if asked:
        raise KeyboardInterrupt


def _alone():
    # One core per process: they divide the candidates, not the poses of one.
    os.environ["RAYON_NUM_THREADS"] = "1"


def _version():
    from pkmkins._core import VERSION

    return VERSION
