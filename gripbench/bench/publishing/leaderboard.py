"""The leaderboard that is kept: every board, and what another run is compared with.

`leaderboard.md` is to be read, `leaderboard.csv` has one line a board and method, and
`leaderboard.json` has those and the sums of every run, so that a later run can be compared with it
run by run (see `gripbench.bench.publishing.regressions`).
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pandas as pd
from pydantic import Field

import gripbench
from gripbench.bench.bounds.stored import Stored
from gripbench.bench.catalogue.suites import load_suite, suite_files
from gripbench.bench.publishing.answer_table import answer_table
from gripbench.bench.publishing.board_tables import Timings, board_table
from gripbench.bench.publishing.columns import Table
from gripbench.bench.publishing.degradation_table import degradation_tables
from gripbench.bench.publishing.tables import markdown
from gripbench.bench.publishing.timings import RelativeRuntime
from gripbench.bench.ranking.answers import Answer, answers, words
from gripbench.bench.ranking.degradation import degradation, without_faults
from gripbench.bench.ranking.grids import ANY, opening, salts_of
from gripbench.bench.ranking.plans import setting_of, standing_of
from gripbench.bench.ranking.ranking import Board, boards
from gripbench.bench.ranking.statistics import CONFIDENCE
from gripbench.configuration import Configuration, parse
from gripbench.errors import InputError
from gripbench.writing import write_atomically

SCHEMA_VERSION = 1
"""Version of leaderboard.json; those of every earlier version still load."""

_MIGRATIONS: dict[int, Callable[[dict[str, Any]], dict[str, Any]]] = {}
"""For each earlier version, the function that turns its content into the next version's."""


class Runs(Configuration):
    """The runs of one method on one scenario, for one target.

    Attributes
    ----------
    seeds, sums_of_squares, counts
        Of the runs that are `ok`.
    failed
        Seeds of the others, with status and reason.
    salt
        Digest of the secret that they were drawn with; empty: none.
    """

    scenario: str
    target: str
    label: str
    seeds: tuple[int, ...]
    sums_of_squares: tuple[float, ...]
    counts: tuple[int, ...]
    failed: dict[int, str] = Field(default_factory=dict)
    salt: str = ""


class Leaderboard(Configuration):
    """What a leaderboard says.

    Attributes
    ----------
    gripbench
        Version that made it.
    confidence
        Confidence of its ranks and intervals.
    answers
        Which method for which road and sensors: the fields of
        `gripbench.bench.ranking.answers.Answer`.
    boards
        Each board: target, sensors, title, scenarios, seeds, notes, and its `methods`, one
        mapping a line with the columns of `gripbench.bench.ranking.ranking.columns`.
    faults
        What each fault does to each method: the columns of
        `gripbench.bench.ranking.degradation.COLUMNS`.
    uncertainty
        As `boards`, those of uncertainty, which are ranked by CRPS.
    runtimes
        Relative runtimes by label and form; empty without timings.
    runs
        What every method did in every run.
    """

    schema_version: int = SCHEMA_VERSION
    gripbench: str
    confidence: float
    answers: tuple[dict[str, Any], ...] = ()
    boards: tuple[dict[str, Any], ...]
    faults: tuple[dict[str, Any], ...] = ()
    uncertainty: tuple[dict[str, Any], ...] = ()
    runtimes: dict[str, dict[str, RelativeRuntime]] = Field(default_factory=dict)
    runs: tuple[Runs, ...]

    def answers_found(self) -> list[Answer]:
        """Return the answers as they were made."""
        found = []
        for one in self.answers:
            known: Any = {key: math.nan if value is None else value for key, value in one.items()}
            found.append(Answer(**{**known, "sensors": tuple(one["sensors"])}))
        return found


def usual_targets(rows: pd.DataFrame) -> list[str]:
    """Return the targets of these rows that the shipped suites name; empty: they name none."""
    named = {name for suite in suite_files() for name in load_suite(suite).targets}
    return sorted(named & set(rows["target"]))


def build(
    rows: pd.DataFrame,
    timings: Timings | None = None,
    confidence: float = CONFIDENCE,
    targets: Iterable[str] = (),
    bounds: Stored | None = None,
) -> tuple[Leaderboard, list[Board]]:
    """Return the leaderboard of these rows, and its boards.

    Production cars (level 1) come first and open with the sensors that they all have; the papers'
    setting comes last. Behind the boards of a target's sensor sets comes one with all its methods
    and what each reads.

    Parameters
    ----------
    rows
        Frame as `gripbench.bench.running.rows.frame_of` returns it.
    timings
        As `publishing.timings.read_timings` returns them; None: no relative runtimes.
    confidence
        Confidence of ranks and intervals.
    targets
        Signals to rank by; empty: all.
    bounds
        Least errors that the sensors allow; None: not known.

    Raises
    ------
    InputError
        If there is nothing to rank, see `gripbench.bench.ranking.ranking.rank`.
    """
    chosen = set(targets) or set(rows["target"])
    rows = rows[rows["target"].isin(chosen)]
    damage = degradation(rows)
    rows = without_faults(rows)
    found = boards(rows, confidence=confidence, bounds=bounds)
    for target in dict.fromkeys(board.target for board in found):
        if len({board.sensors for board in found if board.target == target}) > 1:
            found += boards(rows, target, ANY, confidence=confidence, bounds=bounds)
    found += uncertainty_boards(rows, confidence)
    found.sort(
        key=lambda board: (
            standing_of(board), board.by == "crps", opening(board.sensors) > 0, board.target,
        )
    )  # fmt: skip
    return (
        Leaderboard(
            gripbench=gripbench.__version__,
            confidence=confidence,
            answers=tuple(
                {key: _plain(value) for key, value in vars(one).items()}
                for one in answers(rows, sorted(set(rows["target"]) - {""}))
            ),
            boards=tuple(_content(board) for board in found if board.by == "rms"),
            uncertainty=tuple(_content(board) for board in found if board.by == "crps"),
            faults=tuple(_lines(damage)),
            runtimes={label: dict(forms) for label, forms in (timings or {}).items()},
            runs=tuple(runs_of(rows)),
        ),
        found,
    )


def uncertainty_boards(rows: pd.DataFrame, confidence: float = CONFIDENCE) -> list[Board]:
    """Return the boards by CRPS with all methods of a target, where a method has a CRPS at all."""
    stated = rows[rows["crps"].notna()]
    targets = sorted(set(stated.loc[~stated["baseline"].astype(bool), "target"]) - {""})
    found = [boards(rows, target, ANY, confidence=confidence, by="crps") for target in targets]
    return [board for each in found for board in each if board.lines["score"].notna().any()]


def write(folder: Path, leaderboard: Leaderboard, found: list[Board]) -> list[Path]:
    """Write leaderboard.md, .csv and .json, with faults also faults.csv, and return their paths.

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    texts = {
        "leaderboard.md": text_of(leaderboard, found),
        "leaderboard.csv": _csv(leaderboard, found),
        "leaderboard.json": _json(leaderboard.model_dump()),
    }
    if leaderboard.faults:
        frame = pd.DataFrame(leaderboard.faults)
        texts["faults.csv"] = frame.to_csv(index=False, lineterminator="\n")
    for name, text in texts.items():
        write_atomically(folder / name, text)
    return [folder / name for name in texts]


def read(path: Path) -> Leaderboard:
    """Return a leaderboard from leaderboard.json or the folder that has it.

    Raises
    ------
    InputError
        If it is missing, damaged or of a newer gripbench.
    """
    file = path / "leaderboard.json" if path.is_dir() else path
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{file}: no such file; 'gripbench leaderboard' writes one") from None
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}") from None
    except ValueError:
        raise InputError(f"{file}: not valid JSON; build it again") from None
    version = content.get("schema_version") if isinstance(content, dict) else None
    if not isinstance(version, int) or version < 1:
        raise InputError(f"{file}: key 'schema_version' is {version!r}: not a leaderboard")
    if version > SCHEMA_VERSION:
        raise InputError(
            f"{file}: written by a newer gripbench (schema version {version}, this one reads up "
            f"to {SCHEMA_VERSION}); update gripbench"
        )
    while version < SCHEMA_VERSION:
        content = _MIGRATIONS[version](content)
        version += 1
    return parse(Leaderboard, content, file)


def text_of(leaderboard: Leaderboard, found: list[Board]) -> str:
    """Return the leaderboard as Markdown: the answers, then each board with its own in words."""
    parts = [
        "# Leaderboard",
        "",
        f"gripbench {leaderboard.gripbench}. {ANSWER_TITLE}",
        "",
        _without_caption(answer_table(leaderboard.answers_found())),
        "",
        "One board for each target and each set of instruments that a method may read, then one "
        "with all methods and what they read. Score: geometric mean over the scenarios of the "
        "pooled RMS, 1 is typical of the board; ranks and intervals hold with "
        f"{100 * leaderboard.confidence:g} % (paired over common seeds, bootstrap over runs, "
        "Holm's correction). Failures rank last. Boards of uncertainty rank what methods state of "
        "their errors, by CRPS. `leaderboard.csv` and `gripbench rank --wide` "
        "have every column.",
        "",
    ]
    settings = [setting_of(board.scenarios[0]) if board.scenarios else "" for board in found]
    before = ""
    for board, setting in zip(found, settings, strict=True):
        if setting != before:
            parts += [f"# {_HEADINGS.get(setting, setting.capitalize() or 'Own scenarios')}", ""]
            before = setting
        table = _without_caption(board_table(board, leaderboard.runtimes or None))
        parts += [f"## {board.title}", "", f"**{words(board)}**", "", table, ""]
    if leaderboard.faults:
        parts += ["# Faults of the instruments", ""]
        damage = pd.DataFrame(leaderboard.faults)
        damage["recovery"] = damage["recovery"].fillna(math.inf).where(damage["recovered"].notna())
        for each in degradation_tables(damage):
            parts += [f"## {each.caption}", "", _without_caption(each), ""]
    return "\n".join(parts).rstrip() + "\n"


_HEADINGS = {
    "production spread": "Level 1: every seed another car, road, drive and instruments",
    "the papers' setting": "Level 0, the papers' setting: the very car on paper is driven",
}


ANSWER_TITLE = "Which method for which road and sensors:"


def _without_caption(table: Table) -> str:
    return markdown(table).removeprefix(table.caption).strip()


def _json(content: dict[str, Any]) -> str:
    """Return JSON with one line a board and a method's runs, so that versions can be compared."""
    parts = []
    for key, value in content.items():
        if isinstance(value, list | tuple):
            lines = ",\n  ".join(json.dumps(item, allow_nan=False) for item in value)
            parts.append(f'"{key}": [\n  {lines}\n ]')
        else:
            parts.append(f'"{key}": {json.dumps(value, allow_nan=False)}')
    return "{\n " + ",\n ".join(parts) + "\n}\n"


def _csv(leaderboard: Leaderboard, found: list[Board]) -> str:
    frame = pd.concat([board.lines for board in found], ignore_index=True)
    for form in ("batch", "online"):
        frame[f"relative_{form}"] = [
            runtime.relative if (runtime := leaderboard.runtimes.get(label, {}).get(form)) else None
            for label in frame["label"]
        ]
    return frame.to_csv(index=False, lineterminator="\n")


def _content(board: Board) -> dict[str, Any]:
    return {
        "target": board.target,
        "sensors": list(board.sensors),
        "title": board.title,
        "scenarios": list(board.scenarios),
        "seeds": list(board.seeds),
        "notes": list(board.notes),
        "salt": board.salt,
        "methods": _lines(board.lines),
    }


def _lines(frame: pd.DataFrame) -> list[dict[str, Any]]:
    return [
        {str(key): _plain(value) for key, value in line.items()}
        for line in frame.to_dict("records")
    ]


def _plain(value: Any) -> Any:
    """Return a value that JSON knows; what is not finite becomes null."""
    if hasattr(value, "item"):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def runs_of(rows: pd.DataFrame) -> list[Runs]:
    """Return what every method did in every run, by scenario, target and label."""
    runs = []
    known = rows[rows["target"] != ""]
    for (scenario, target, label), group in known.groupby(["scenario", "target", "label"]):
        group = group.sort_values("seed")
        good = group[group["status"] == "ok"]
        bad = group[group["status"] != "ok"]
        runs.append(
            Runs(
                scenario=str(scenario),
                target=str(target),
                label=str(label),
                seeds=tuple(int(seed) for seed in good["seed"]),
                sums_of_squares=tuple(float(value) for value in good["sum_of_squares"]),
                counts=tuple(int(value) for value in good["count"]),
                salt=next(iter(salts_of(group)), ""),
                failed={
                    int(seed): f"{status}: {reason}".removesuffix(": ")
                    for seed, status, reason in zip(
                        bad["seed"], bad["status"], bad["reason"], strict=True
                    )
                },
            )
        )
    return runs
