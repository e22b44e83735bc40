"""Rows and boards in; in words and as a table, which method to take, how good it is, how sure out.

The answer of a board is its best method that a vehicle could run: no baseline, none that
reads a channel which no sensor gives, none below what the sensors allow, and none that was
computed outside and not checked.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import pandas as pd

from gripbench.bench.ranking.grids import opening
from gripbench.bench.ranking.plans import plan_of, road_of, setting_of, standing
from gripbench.bench.ranking.ranking import Board, boards
from gripbench.bench.running.recorded_scenarios import PREFIX
from gripbench.bench.scoring.consistency import SILENT
from gripbench.envs.signals import IDEALISED, signal
from gripbench.errors import InputError

ROADS = ("any", "dry", "wet", "snow", "ice", "changing", "real drive", "unknown")
"""Kinds of road in the order of the table."""


@dataclass(frozen=True)
class Answer:
    """Which method to take for one target on one kind of road with one set of sensors.

    Attributes
    ----------
    target, plan, road, sensors
        The question; `plan` is the suite, or empty.
    method
        Label of the best method, empty where there is none.
    guess
        Label of the best baseline, empty where none was run.
    error, low, high
        Its pooled RMS with interval, in the unit in which people see the target.
    unit
        That unit.
    better
        Share of the drives in which it is better than the best baseline; NaN without one.
    skill
        One less its error over that of the best baseline; NaN without one.
    drives
        Number of drives.
    setting
        What cars were driven, in words, see `plans.setting_of`.
    """

    target: str
    plan: str
    road: str
    sensors: tuple[str, ...]
    method: str
    guess: str
    error: float
    low: float
    high: float
    unit: str
    better: float
    skill: float
    drives: int
    setting: str = ""

    @property
    def useful(self) -> bool:
        """Whether the method is better than a guess, or there is no guess to compare with."""
        return not self.skill <= 0.0


def best_line(board: Board) -> Any | None:
    """Return the line of the method that a board recommends, None where it has none."""
    lines = board.lines
    checked = ~lines["baseline"].astype(bool) & ~lines["computed_outside"]
    checked &= lines["below_bound"] == ""
    real = lines[checked & (lines["idealised"] == "")]
    real = real[real["score"].notna()]
    return None if real.empty else real.iloc[0]


def words_of_uncertainty(board: Board) -> str:
    """Return in words what a board by CRPS says: who states its errors best, who states none."""
    shown = signal(board.target)
    line = best_line(board)
    silent = [str(name) for name in board.lines.loc[board.lines["uncertainty"] == SILENT, "label"]]
    end = f" Without a word on their errors: {', '.join(silent)}." if silent else ""
    if line is None:
        return "No method that a vehicle could run states its errors in every drive." + end
    unit = "" if shown.display_unit == "-" else f" {shown.display_unit}"
    with_ = "With any sensors" if line["sensors"] == "any" else f"With {line['sensors']}"
    text = (
        f"{with_} {line['label']} knows its errors best: CRPS "
        f"{shown.display_factor * line['crps']:.3g}{unit} over {int(line['cells'])} drives, "
        f"{line['uncertainty']}"
    )
    if pd.notna(line["coverage_90"]):
        text += f" (its 90 % interval holds the truth in {100 * line['coverage_90']:.0f} %)"
    if board.guess and line["verdict"]:
        text += f"; {board.guess} says no less"
    elif board.guess:
        text += (
            f"; better than what {board.guess} says in "
            f"{100 * line['beats_guess']:.0f} % of the drives"
        )
    return text + "." + end


def words(board: Board) -> str:
    """Return in words what a board says: what to take, how good it is, what may be as good."""
    if board.by == "crps":
        return words_of_uncertainty(board)
    line = best_line(board)
    if line is None:
        return "No method that a vehicle could run finished every drive."
    with_ = "With any sensors" if line["sensors"] == "any" else f"With {line['sensors']}"
    what = "windows of one drive" if recorded(board) else "drives"
    error = f"{_error(board, line)} over {int(line['cells'])} {what}"
    useless = board.lines[board.lines["verdict"] != ""]
    if line["verdict"]:
        guess = board.lines[board.lines["label"] == board.guess].iloc[0]
        return (
            f"{with_} no method is better than the guess {board.guess}: {_error(board, guess)}. "
            f"The best of them is {line['label']}: {error}." + _distance(board, line)
        )
    order = list(board.lines["label"])
    place = order.index(line["label"])
    parts = [f"{with_} take {line['label']}: {error}"]
    if pd.notna(line["beats_next"]) and order[place + 1] != board.guess:
        parts.append(f"better than {order[place + 1]} in {100 * line['beats_next']:.0f} % of them")
    if board.guess:
        parts.append(
            f"better than the guess {board.guess} in {100 * line['beats_guess']:.0f} % of them"
        )
    text = ", ".join(parts) + "." + _distance(board, line)
    if line["worse_than_guess"]:
        text += f" Worse than that guess in {line['worse_than_guess']}."
    rivals = board.lines[(board.lines["rank_from"] == 1) & board.lines["score"].notna()]
    alike = [name for name in rivals["label"] if name != line["label"]]
    if alike and line["rank_from"] == 1:
        text += f" These {what} do not tell it apart from {_listed(alike)}."
    others = [name for name in useless["label"] if name != line["label"]]
    if others:
        text += f" No better than a guess: {', '.join(others)}."
    return text


def _distance(board: Board, line: Any) -> str:
    """Return in words how far the best method is from the least error, and who is below it."""
    text = ""
    if pd.notna(line["bound"]) and pd.notna(line["bound_ratio"]):
        shown = signal(board.target)
        unit = "" if shown.display_unit == "-" else f" {shown.display_unit}"
        text = (
            f" The least that these sensors allow is {shown.display_factor * line['bound']:.2g}"
            f"{unit}: it is {line['bound_ratio']:.3g} times the bound."
        )
    below = list(board.lines.loc[board.lines["below_bound"] != "", "label"])
    if below:
        text += f" Below what the sensors allow: {', '.join(below)}."
    return text


def recorded(board: Board) -> bool:
    """Return whether a board is of a recording: its runs are windows of one drive."""
    return bool(board.scenarios) and board.scenarios[0].startswith(PREFIX)


def _error(board: Board, line: Any) -> str:
    """Return a method's error with its unit and interval."""
    shown = signal(board.target)
    unit = "" if shown.display_unit == "-" else f" {shown.display_unit}"
    error = f"{shown.display_factor * line['rms']:.3g}{unit} RMS"
    if pd.isna(line["rms_from"]):
        return error
    ends = (shown.display_factor * line["rms_from"], shown.display_factor * line["rms_to"])
    return f"{error} ({100 * board.confidence:g} %: {ends[0]:.3g} to {ends[1]:.3g})"


def _listed(names: list[str]) -> str:
    """Return names with commas and a last `or`; of many the first three and their number."""
    if len(names) > _MOST_NAMED:
        return f"{', '.join(names[:3])} or {len(names) - 3} others"
    return " or ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


_MOST_NAMED = 4


def answers(rows: pd.DataFrame, targets: Iterable[str]) -> list[Answer]:
    """Return the answers for every target, plan, kind of road and set of sensors.

    A set of sensors is left out where a smaller one gives the same method, or one with no larger
    error: what it adds is not used. So are sets with a channel that no sensor gives. First stands
    what holds for production cars (level 1), and there what their own sensors allow; last what
    repeats the papers.

    Parameters
    ----------
    rows
        Frame as `gripbench.bench.running.rows.frame_of` returns it.
    targets
        Signals that are estimated.
    """
    found: list[tuple[int, Answer]] = []
    for target in targets:
        ran = rows[(rows["target"] == target) & (rows["status"] != "skipped")]
        roads = {name: (plan_of(name), road_of(name)) for name in ran["scenario"].unique()}
        kinds = sorted(set(roads.values()), key=lambda kind: (kind[0], ROADS.index(kind[1])))
        for kind in kinds:
            names = [name for name, its in roads.items() if its == kind]
            place = min(map(standing, names))
            part = rows[rows["scenario"].isin(names)]
            setting = setting_of(names[0])
            found += [(place, one) for one in _of_road(part, target, *kind, setting)]
    found.sort(key=lambda item: (item[0], opening(item[1].sensors) == 2))
    return [one for _, one in found]


def _of_road(rows: pd.DataFrame, target: str, plan: str, road: str, setting: str) -> list[Answer]:
    try:
        made = boards(rows, target, resamples=200)
    except InputError:
        return []  # nothing ran there, or not over common seeds: the boards say so
    found: list[Answer] = []
    for board in sorted(made, key=lambda board: len(board.sensors)):
        line = best_line(board)
        if line is None or IDEALISED in board.sensors:
            continue
        shown = signal(target)
        error = shown.display_factor * float(line["rms"])
        known = (one for one in found if set(one.sensors) <= set(board.sensors))
        if any(one.method == line["label"] or one.error <= error for one in known):
            continue
        found.append(
            Answer(
                target=target,
                plan=plan,
                road=road,
                sensors=board.sensors,
                method=str(line["label"]),
                guess=board.guess,
                error=error,
                low=shown.display_factor * float(line["rms_from"]),
                high=shown.display_factor * float(line["rms_to"]),
                unit="" if shown.display_unit == "-" else shown.display_unit,
                better=float(line["beats_guess"]),
                skill=float(line["skill"]),
                drives=int(line["cells"]),
                setting=setting,
            )
        )
    return found
