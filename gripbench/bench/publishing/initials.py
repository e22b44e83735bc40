"""Instruments in, the letters that stand for them in a narrow table out."""

from __future__ import annotations

_INITIALS = {
    "wheel speed sensor": "W",
    "torque on the vehicle bus": "T",
    "accelerometer": "A",
    "gyroscope": "G",
    "steering angle sensor": "S",
    "GPS receiver": "P",
    "magnetometer": "M",
    "optical speed sensor": "O",
    "road grade estimate": "E",
    "road bank map": "B",
    "idealised": "†",
}
"""Letters of instruments in a narrow table."""


def instruments_of(reads: str) -> list[str]:
    """Return the instruments of a line's column `reads`."""
    return [name for name in reads.split(", ") if name]


def initial(instrument: str) -> str:
    """Return the letter of an instrument."""
    return _INITIALS.get(instrument, instrument[:1].lower())
