"""Engines that run chunks of work: joblib's loky on this machine, Dask or Ray on a cluster.

An engine takes a function and an iterable of arguments and yields the results in whatever order
they are finished, with a bounded number under way. It keeps nothing else, so another engine is
one function in `ENGINES`.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from typing import Any

from gripbench.errors import GripbenchError, InputError, unknown

Work = Callable[[Any], Any]


class WorkerLostError(GripbenchError):
    """Worker processes died and took their chunks with them; what they returned is kept."""


@dataclass(frozen=True)
class Backend:
    """Where to run.

    Attributes
    ----------
    name
        `loky`, `dask` or `ray`.
    workers
        Number of processes on this machine; a cluster has its own.
    scheduler
        Address of the cluster's scheduler; empty: one on this machine.
    """

    name: str = "loky"
    workers: int = 0
    scheduler: str = ""

    @property
    def processes(self) -> int:
        """Number of processes on this machine."""
        return self.workers or os.cpu_count() or 1

    def run(self, work: Work, chunks: Iterable[Any]) -> Iterator[Any]:
        """Yield the results of `work(chunk)`, in the order in which they are finished.

        Raises
        ------
        WorkerLostError
            If worker processes died; the engine can be started again.
        """
        if self.name not in ENGINES:
            raise unknown("backend", self.name, ENGINES)
        if self.scheduler and self.name == "loky":
            raise InputError("--scheduler needs a cluster's backend: --backend dask or ray")
        return ENGINES[self.name](self, work, chunks)


def _loky(backend: Backend, work: Work, chunks: Iterable[Any]) -> Iterator[Any]:
    from joblib.externals.loky.process_executor import BrokenProcessPool, ProcessPoolExecutor

    if backend.processes == 1:
        yield from map(work, chunks)
        return
    # Processes of this run alone: whatever they imported ends with it.
    executor = ProcessPoolExecutor(backend.processes, env=_ONE_THREAD)
    parent = os.getpid()

    def submit(number: int) -> set[Future[Any]]:
        with _interrupts_held():  # processes that start now never see the user's interrupt
            return {
                executor.submit(_in_worker, work, chunk, parent)
                for chunk in itertools.islice(pending, number)
            }

    pending = iter(chunks)
    try:
        under_way = submit(3 * backend.processes)
        while under_way:
            done, under_way = wait(under_way, return_when=FIRST_COMPLETED)
            under_way |= submit(len(done))
            for future in sorted(done, key=lambda one: one.exception() is not None):
                yield future.result()  # what came back first, then what was lost
    except BrokenProcessPool as error:
        raise WorkerLostError(f"a worker process died: {str(error).splitlines()[0]}") from None
    finally:
        with _interrupts_held():
            executor.shutdown(wait=True, kill_workers=True)


_ONE_THREAD = {
    name: os.environ.get(name, "1")
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
}


@contextlib.contextmanager
def _interrupts_held() -> Iterator[None]:
    """Hold the user's interrupt back until the end of the block; what starts in it never gets one.

    A terminal sends it to all processes. This one ends the others, in order and without their
    tracebacks.
    """
    if not hasattr(signal, "pthread_sigmask"):  # not on this system
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


_watched: set[int] = set()


def _in_worker(work: Work, chunk: Any, parent: int) -> Any:
    """Run a chunk in a loky worker, which must not outlive the process that it works for."""
    if parent not in _watched:
        _watched.add(parent)
        threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()
    return work(chunk)


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(0.5)
    os._exit(1)


def _dask(backend: Backend, work: Work, chunks: Iterable[Any]) -> Iterator[Any]:
    try:
        import distributed
    except ImportError:
        raise InputError("--backend dask needs: pip install 'gripbench[dask]'") from None
    try:
        with _interrupts_held():
            if backend.scheduler:
                client = distributed.Client(backend.scheduler, timeout=10.0)
            else:
                client = distributed.Client(
                    n_workers=backend.processes, threads_per_worker=1, dashboard_address=None
                )
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(f"Dask scheduler '{backend.scheduler}': {error}") from None
    with client:
        pending = iter(chunks)
        size = max(2 * len(client.nthreads()), 4)
        under_way = distributed.as_completed(
            client.map(work, list(itertools.islice(pending, size)), pure=False)
        )
        for future in under_way:
            try:
                result = future.result()
            except distributed.scheduler.KilledWorker as error:
                raise WorkerLostError(f"Dask gave a chunk up: {error}") from None
            future.release()
            under_way.update(
                client.submit(work, chunk, pure=False) for chunk in itertools.islice(pending, 1)
            )
            yield result


def _ray(backend: Backend, work: Work, chunks: Iterable[Any]) -> Iterator[Any]:
    try:
        import ray  # type: ignore[import-not-found, import-untyped, unused-ignore]
    except ImportError:
        raise InputError("--backend ray needs: pip install 'gripbench[ray]'") from None
    where = {"address": backend.scheduler} if backend.scheduler else {"num_cpus": backend.processes}
    ray.init(ignore_reinit_error=True, log_to_driver=False, **where)
    try:
        remote = ray.remote(work)
        pending = iter(chunks)
        size = max(2 * int(ray.cluster_resources().get("CPU", 1)), 4)
        under_way = [remote.remote(chunk) for chunk in itertools.islice(pending, size)]
        while under_way:
            done, under_way = ray.wait(under_way)
            under_way += [remote.remote(chunk) for chunk in itertools.islice(pending, len(done))]
            try:
                yield from ray.get(done)
            except ray.exceptions.WorkerCrashedError as error:
                raise WorkerLostError(f"Ray gave a chunk up: {error}") from None
    finally:
        ray.shutdown()


ENGINES: dict[str, Callable[[Backend, Work, Iterable[Any]], Iterator[Any]]] = {
    "loky": _loky,
    "dask": _dask,
    "ray": _ray,
}
"""Engines by name."""
