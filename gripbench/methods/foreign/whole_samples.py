"""Samples as sensors give them in, whole samples in order out, for methods that are no step.

The same rules as for a compiled step, see `gripbench.methods.samples`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gripbench.methods.samples import admit, layout_of, memory_of


class WholeSamples:
    """Admits samples one by one.

    Parameters
    ----------
    channels
        The m channels of a sample.
    """

    def __init__(self, channels: tuple[str, ...]) -> None:
        self._channels = channels
        self._memory, self._layout = memory_of(channels), layout_of(channels)
        self._row = np.zeros(len(channels) + 3)

    def take(self, obs: Mapping[str, float]) -> tuple[list[float], float, float] | None:
        """Return the channels' values, time and elapsed time [s]; None where nothing is to be done.

        Parameters
        ----------
        obs
            `time` and the channels.
        """
        self._row[:] = [*(obs[name] for name in self._channels), obs["time"], 0.0, 0.0]
        if not admit(self._row, self._memory, self._layout):
            return None
        *values, time, elapsed, _ = self._row.tolist()
        return values, time, elapsed
