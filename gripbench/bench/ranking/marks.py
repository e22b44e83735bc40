"""The label of a method in; the same with the marks that stand behind it in every table out."""

from __future__ import annotations

import math

MARK = "†"
"""Follows the name of a method that reads a channel which no sensor in a vehicle gives."""

FOOTNOTE = f"{MARK} reads an idealised channel, which no sensor in a vehicle gives"

OUTSIDE = "‡"
"""Follows the name of a method whose estimates were handed in."""

MARKED_BY = ("idealised", "computed_outside", "training", "over_prefixes")
"""Columns that decide on a method's marks, in the order in which `marked` takes them."""

TRAINED = "§"
"""Follows the name of a method that was trained."""

OUTSIDE_FOOTNOTE = f"{OUTSIDE} computed outside: neither causality nor runtime checked"


OVER_PREFIXES = "¶"
"""Follows the name of a method that takes whole recordings."""

PREFIX_FOOTNOTE = f"{OVER_PREFIXES} takes whole recordings: causality checked at random cuts"


def marked(
    label: str,
    idealised: str | tuple[str, ...],
    outside: bool = False,
    training: str = "",
    over_prefixes: bool = False,
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
    over_prefixes
        Whether it takes whole recordings.
    """
    marks = (
        (MARK, idealised),
        (OUTSIDE, outside),
        (TRAINED, training),
        (OVER_PREFIXES, over_prefixes),
    )
    return label + "".join(mark for mark, there in marks if there)


def training_note(label: str, training: str, seconds: float) -> str:
    """Return the sentence on a method's training."""
    took = "" if math.isnan(seconds) else f", in {seconds:.3g} s"
    return f"{label}{TRAINED} {training}{took}"
