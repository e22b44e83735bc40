"""Agreements of recordings with populations as tables."""

from __future__ import annotations

from collections.abc import Sequence

from gripbench.bench.publishing.board_tables import GUESS
from gripbench.bench.publishing.columns import Column, Table
from gripbench.bench.ranking.agreement import Agreement
from gripbench.bench.running.recorded_scenarios import PREFIX
from gripbench.envs.signals import signal


def agreement_table(found: Sequence[Agreement], confidence: float) -> Table:
    """Return a line an agreement."""
    columns = (
        Column("recording", "Recording"),
        Column("population", "Population"),
        Column("target", "Target"),
        Column("methods", "Methods", format="d"),
        Column("tau", "Kendall's tau", format=".2f"),
        Column("interval", f"{100.0 * confidence:g} %"),
        Column("p", "p", format=".2g"),
        Column("turned", "Pairs turned round", format="d"),
    )
    rows = tuple(
        {
            "recording": one.recording.removeprefix(PREFIX),
            "population": one.population,
            "target": one.target,
            "methods": len(one.methods),
            "tau": one.tau,
            "interval": f"{one.low:.2f} to {one.high:.2f}" if one.low == one.low else "",
            "p": one.p,
            "turned": len(one.turned),
        }
        for one in found
    )
    note = (
        "Interval: other drives of the population, other windows of the recording. p: chance of "
        "such a tau if the orders had nothing in common. Turned round: in the opposite order, "
        "significantly so on both sides."
    )
    return Table(columns, rows, "Order of the methods on recordings and in populations", (note,))


def order_table(one: Agreement) -> Table:
    """Return both orders of an agreement."""
    unit, factor = signal(one.target).display_unit, signal(one.target).display_factor
    unit = unit.replace("-", "")
    methods = one.methods.assign(
        place=one.methods["recording"].rank(method="min").astype(int),
        other=one.methods["population"].rank(method="min").astype(int),
        label=[
            f"{label} {GUESS}" if baseline else label
            for label, baseline in zip(one.methods["label"], one.methods["baseline"], strict=True)
        ],
    )
    methods[["recording", "population"]] *= factor
    columns = (
        Column("place", "Recording", format="d"),
        Column("other", "Population", format="d"),
        Column("label", "Method"),
        Column("recording", "RMS on the recording", unit, ".3g"),
        Column("population", "RMS in the population", unit, ".3g"),
    )
    turned = ", ".join(f"{better} before {worse}" for better, worse in one.turned)
    notes = (f"Turned round: {turned}.",) if turned else ()
    name = one.recording.removeprefix(PREFIX)
    caption = f"{one.target}: {name} beside {one.population}"
    return Table.from_frame(methods, columns, caption, notes)
