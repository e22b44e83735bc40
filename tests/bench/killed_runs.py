"""Start a run again and again and kill each with SIGKILL at a random moment.

A process that has imported and compiled everything forks for each run, so that the kill hits a
run at work and not an interpreter that starts. Printed: the number of rows that each kill left.
"""

import json
import os
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import gripbench
from gripbench.bench.store import Store


def main(arguments: str, results: str, warm: str, kills: int) -> None:
    chosen = json.loads(arguments)
    gripbench.run(**{**chosen, "seeds": 2}, results=warm)  # compiles
    start = _seconds(lambda: gripbench.run(**{**chosen, "seeds": 2}, results=warm))
    more = _seconds(lambda: gripbench.run(**{**chosen, "seeds": 22}, results=warm)) - start
    work = max(more, 0.0) * chosen["seeds"] / 20
    longest = 1.2 * start + 1.5 * work / kills  # all kills together: before the run is complete
    generator = np.random.default_rng(5)
    kept = []
    for _ in range(kills):
        child = os.fork()
        if child == 0:
            gripbench.run(**chosen, results=results)
            os._exit(0)
        time.sleep(generator.uniform(0.0, longest))
        os.kill(child, signal.SIGKILL)
        _, status = os.waitpid(child, 0)
        if os.WIFSIGNALED(status):
            kept.append(sum(1 for _ in Store(Path(results)).files()))
    print(json.dumps(kept))


def _seconds(action: Callable[[], object]) -> float:
    began = time.perf_counter()
    action()
    return time.perf_counter() - began


if __name__ == "__main__":
    main(*sys.argv[1:4], int(sys.argv[4]))
