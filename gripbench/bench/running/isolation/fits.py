"""A method and its training drives in, what it learned out: both ends of the pipe between.

Drives go over as bytes, one after the other; numbers come back and nothing else, see
`gripbench.bench.catalogue.arrays`. Whatever `fit` does to its process, only the fit is lost.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import Any

from gripbench.bench.catalogue.arrays import LARGEST, numbers_of_fit, packed, unpacked
from gripbench.bench.running.isolation.limits import CellFailure
from gripbench.bench.running.isolation.lines import LateError
from gripbench.bench.running.isolation.loading import Settings, named_seed, read_by
from gripbench.bench.running.isolation.messages import message_bytes, read_message
from gripbench.bench.running.isolation.sandbox import LOADING, Sandbox
from gripbench.bench.running.isolation.training_drives import TrainingDrive, received
from gripbench.errors import GripbenchError, InputError


class FittingSandbox(Sandbox):
    """A sandbox in which a method is fitted."""

    def fit(
        self, settings: Settings, drives: Iterable[TrainingDrive], budget: int, limit: float
    ) -> tuple[bytes, float, dict[str, Any]]:
        """Have a method fitted.

        Parameters
        ----------
        settings
            The method.
        drives
            Training drives, sent one by one.
        budget
            Passes over them that it may make.
        limit
            Time [s] that it may take once it has them.

        Returns
        -------
        What it returned, packed; the time that it took [s]; what it was seen to read.

        Raises
        ------
        CellFailure
            As `execute`.
        """
        declaration = self.load(settings).declaration
        process = self._process
        assert process is not None
        line = process.open_cell({"fit": budget, "seed": named_seed(declaration.name, "fit")})
        try:
            for drive in drives:
                for part in drive.messages():
                    line.put(part, time.monotonic() + LOADING)
            began = time.monotonic()
            answer = self._answer(line, began + limit, limit, {"end": True})
            took = time.monotonic() - began
            size = answer.get("state")
            if not isinstance(size, int) or not 0 <= size <= 2 * LARGEST:
                raise ValueError("no state")
            content = line.receive(size, began + limit + LOADING)
            return packed(numbers_of_fit(unpacked(content))), took, read_by(answer)
        except (CellFailure, InputError):  # of the method, or of who makes the drives
            raise
        except (LateError, EOFError, OSError) as error:
            self._lost(error, limit)
            raise
        except (ValueError, TypeError, GripbenchError) as error:
            self.close()
            raise CellFailure("failed", f"its answer cannot be read: {error}") from None
        finally:
            self._end_cell(process, line)


def fit_answer(
    make: Callable[[], Any],
    budget: int,
    receive: Callable[[int], bytes],
    read: Callable[[], dict[str, Any]],
) -> bytes:
    """Have a method fitted in this, its own, process and return the answer to who asked.

    Parameters
    ----------
    make
        Returns a new estimator.
    budget
        Passes over the drives that it may make.
    receive
        Returns so many bytes of the drives.
    read
        Returns what this process has read.
    """
    drives = []
    while "end" not in (head := read_message(receive)):
        drives.append(received(head, receive))
    content = packed(numbers_of_fit(make().fit(tuple(drives), budget)))
    return message_bytes({"status": "ok", "state": len(content), "read": read()}) + content
