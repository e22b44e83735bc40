"""The label of a method in; the same with the marks that stand behind it in every table out."""

from __future__ import annotations

import math

MARK = "†"
"""Follows the name of a method that reads a channel which no sensor in a vehicle gives."""

FOOTNOTE = f"{MARK} reads an idealised channel, which no sensor in a vehicle gives"

OUTSIDE = "‡"
"""Follows the name of a method whose estimates were handed in."""

MARKED_BY = ("idealised", "computed_outside", "training")
"""Columns that decide on a method's marks, in the order in which `marked` takes them."""

TRAINED = "§"
"""Follows the name of a method that was trained."""

OUTSIDE_FOOTNOTE = f"{OUTSIDE} computed outside: neither causality nor runtime checked"


def marked(
    label: str, idealised: str | tuple[str, ...], outside: bool = False, training: str = ""
) -> str:
    """Return a method's label with its marks.

    Parameters
    ----------
    label
        The label.
    idealised
        Idealised channels that it reads.
    outside
        Whether its estimates were handed in.
    training
        How it was trained.
    """
    marks = ((MARK, idealised), (OUTSIDE, outside), (TRAINED, training))
    return label + "".join(mark for mark, there in marks if there)


def training_note(label: str, training: str, seconds: float) -> str:
    """Return the sentence on a method's training."""
    took = "" if math.isnan(seconds) else f", in {seconds:.3g} s"
    return f"{label}{TRAINED} {training}{took}"
