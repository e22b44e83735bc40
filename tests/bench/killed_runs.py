"""Start a run again and again and kill each with SIGKILL at a random moment.

A process that has imported and compiled everything forks for each run, so that the kill hits a
run at work and not an interpreter that starts. Printed: the number of rows that each kill left.
"""

import json
import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

import gripbench
from gripbench.bench.running.store import Store


def main(arguments: str, results: str, warm: str, kills: int) -> None:
    chosen = json.loads(arguments)
    gripbench.run(**{**chosen, "seeds": 2}, results=warm)  # compiles
    cells = chosen["seeds"] * len(chosen["methods"])
    generator = np.random.default_rng(5)
    kept = []
    # the kills follow the rows and not the clock: on a busy machine, too, each hits a run at work
    for rows in sorted(generator.integers(0, int(0.9 * cells), size=kills)):
        child = os.fork()
        if child == 0:
            gripbench.run(**chosen, results=results)
            os._exit(0)
        while _stored(results) < rows:
            time.sleep(0.001)
        time.sleep(generator.uniform(0.0, 0.01))
        os.kill(child, signal.SIGKILL)
        _, status = os.waitpid(child, 0)
        if os.WIFSIGNALED(status):
            kept.append(_stored(results))
    print(json.dumps(kept))


def _stored(results: str) -> int:
    return sum(1 for _ in Store(Path(results)).files())


if __name__ == "__main__":
    main(*sys.argv[1:4], int(sys.argv[4]))
