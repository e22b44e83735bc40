"""Samples, estimates and messages into bytes and back: all that a plug-in's process reads and says.

Samples and estimates are fixed binary records, messages are JSON: neither side ever unpickles what
the other one wrote. A sample is a request of one record; its reply repeats the request's nonce and
index, so that a reply that nobody asked for is noticed.
"""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

HEADER = struct.Struct("=QQQQ")
"""Head of a reply: nonce and index of its request, number of the process, kind."""

ESTIMATES, FAILURE, FINISHED = range(3)
"""Kinds of replies: estimates of a sample, why the method failed, how the cell ended."""

END = 2**64 - 1
"""Index of the request that says that there are no more samples."""

LONGEST_MESSAGE = 1 << 20
"""Largest number of bytes of a message of a plug-in's process."""

_LENGTH = struct.Struct("=Q")


def request_type(channels: int) -> np.dtype[Any]:
    """Return the record of a request: who asks, which sample, and its values, `time` last."""
    return np.dtype([("nonce", "=u8"), ("index", "=u8"), ("sample", "=f8", (channels + 1,))])


def reply_type(outputs: int) -> np.dtype[Any]:
    """Return the record of a reply: its head, the time that the step took [ns], the estimates."""
    return np.dtype(
        [
            ("nonce", "=u8"),
            ("index", "=u8"),
            ("process", "=u8"),
            ("kind", "=u8"),
            ("took", "=u8"),
            ("estimates", "=f8", (outputs,)),
        ]
    )


def requests_of(observations: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return the requests of a recording, the one that ends it included, with fresh nonces.

    Parameters
    ----------
    observations
        Structured array of float64 fields, shape (n,), `time` last.

    Returns
    -------
    Structured array, shape (n + 1,).
    """
    length, width = len(observations), len(observations.dtype.names or ())
    requests = np.zeros(length + 1, request_type(width - 1))
    requests["nonce"] = np.frombuffer(os.urandom(8 * (length + 1)), "=u8")
    requests["index"][:-1] = np.arange(length)
    requests["index"][-1] = END
    requests["sample"][:-1] = observations.view(np.float64).reshape(length, width)
    return requests


def message_bytes(content: dict[str, Any]) -> bytes:
    """Return a message with its length in front; whatever text it holds, the bytes are ASCII."""
    text = json.dumps(content).encode("ascii")
    return _LENGTH.pack(len(text)) + text


def read_message(receive: Callable[[int], bytes]) -> dict[str, Any]:
    """Return the next message.

    Parameters
    ----------
    receive
        Returns exactly as many bytes as it is asked for, or raises.

    Raises
    ------
    ValueError
        If it is too long or is no message.
    """
    (length,) = _LENGTH.unpack(receive(_LENGTH.size))
    if length > LONGEST_MESSAGE:
        raise ValueError(f"a message of {length} bytes")
    content = json.loads(receive(length))
    if not isinstance(content, dict):
        raise ValueError("no message")
    return content
