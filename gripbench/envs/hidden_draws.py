"""Words that name a random stream in, its entropy out: a secret gives every seed other draws.

Where the environment has a secret (`GRIPBENCH_SALT`), every random stream of a run, those of cars,
roads, drives, noise and faults, starts from a digest of its name and seed under that secret. The
same seed then is a drive that nobody who lacks the secret can simulate. Without one a stream starts
from its name and seed as they are.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache

from gripbench.errors import InputError

VARIABLE = "GRIPBENCH_SALT"
"""Variable of the environment that holds the secret."""

SHORTEST = 16
"""Fewest characters of a secret: a shorter one can be found by trying."""


def salt() -> str:
    """Return the secret of the environment; empty: there is none, seeds are public.

    Raises
    ------
    InputError
        If it is too short to be one.
    """
    found = os.environ.get(VARIABLE, "")
    if found and len(found) < SHORTEST:
        raise InputError(
            f"the environment variable {VARIABLE} has {len(found)} characters; give at least "
            f'{SHORTEST}, as python -c "import secrets; print(secrets.token_hex(32))" prints'
        )
    return found


@contextmanager
def drawn_with(secret: str) -> Iterator[None]:
    """Have runs drawn with a secret, or none where it is empty, until the block ends."""
    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = secret
    try:
        yield
    finally:
        del os.environ[VARIABLE]
        if before is not None:
            os.environ[VARIABLE] = before


def entropy(*words: int) -> list[int]:
    """Return what a random stream starts from: the words, or one number of 256 bits for them.

    Parameters
    ----------
    *words
        The seed, and what names the stream.
    """
    secret = salt()
    if not secret:
        return list(words)
    key = hashlib.sha512(secret.encode("utf-8", "surrogateescape")).digest()
    state = hashlib.blake2b(key=key, digest_size=32, person=b"gripbench draws")
    state.update(",".join(map(str, words)).encode())
    return [int.from_bytes(state.digest())]


def salt_digest() -> str:
    """Return what rows tell of the secret, 32 hexadecimal digits; empty where there is none."""
    return _digest(salt())


@lru_cache(maxsize=8)
def _digest(secret: str) -> str:
    if not secret:
        return ""
    # slow on purpose: who guesses secrets pays this for each
    content = secret.encode("utf-8", "surrogateescape")
    return hashlib.scrypt(content, salt=b"gripbench rows", n=2**14, r=8, p=1, dklen=16).hex()
