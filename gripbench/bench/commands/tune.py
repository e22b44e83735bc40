"""`gripbench tune`: a method's settings, on drives that are never tested, as a named variant."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gripbench.bench.commands import RUN


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("tune", rich_help_panel=RUN)(tune)


def tune(
    words: Annotated[
        list[str],
        typer.Argument(
            metavar="[RECORDING] METHOD",
            help="A method, as `run --method` takes it; before it a recording's name, folder or "
            "map, unless scenarios are given.",
        ),
    ],
    suite: Annotated[str, typer.Option(help="A suite, on whose scenarios to tune.")] = "",
    scenario: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="A scenario on which to tune; repeat for more."),
    ] = None,
    target: Annotated[str, typer.Option(help="Signal whose error counts.")] = "sideslip",
    budget: Annotated[
        int, typer.Option("--budget", "--draws", min=1, help="Settings to try.")
    ] = 60,
    drives: Annotated[int, typer.Option(min=1, help="Drives of each scenario.")] = 8,
    out: Annotated[
        Path | None,
        typer.Option(help="Write the variant to this TOML file; run --method FILE.toml runs it."),
    ] = None,
    data: Annotated[
        Path | None, typer.Option(help="Folder of the recordings' files instead of the usual one.")
    ] = None,
) -> None:
    """Tune a method over its parameters' ranges, on training windows or on training drives.

    Training drives are at level 1 of the scenarios' population, from seeds that no test may touch.
    """
    from gripbench.bench.catalogue.suites import load_suite
    from gripbench.bench.running.course_tuning import tune_on
    from gripbench.bench.running.tuning import settings_text, tune_recording, write_variant
    from gripbench.envs.signals import signal
    from gripbench.errors import InputError
    from gripbench.logs.locations import use_data_folder
    from gripbench.writing import check_writable

    simulated = bool(suite or scenario)
    if len(words) != (1 if simulated else 2):
        raise InputError(
            f"tune {' '.join(words)}: give METHOD with --suite or --scenario, or RECORDING METHOD"
        )
    if out is not None:
        check_writable(out)
    if simulated:
        chosen = load_suite(suite) if suite else None
        names = [*(chosen.scenarios if chosen else ()), *(scenario or ())]
        called = chosen.name if chosen else ""
        tuned = tune_on(words[0], names, target, called, budget, drives)
        assert tuned.training is not None
        where = (
            f"{tuned.training.drives} drives of {tuned.training.on}, seeds "
            f"{tuned.training.seeds[0]}:{tuned.training.seeds[1]}, in {tuned.seconds:.3g} s"
        )
    else:
        use_data_folder(data)
        recording, method = words
        tuned = tune_recording(recording, method, target, budget)
        spans = ", ".join(f"{start:.3f} to {end:.3f} s" for start, end in tuned.windows)
        where = f"the training windows {spans}"
    print(
        f"# {tuned.draws} trials, {target} on {where}: RMS "
        f"{tuned.before:.3g} {signal(target).unit} before, {tuned.after:.3g} after"
    )
    if tuned.undetermined:
        print(f"# at an end of its range, so not settled: {', '.join(tuned.undetermined)}")
    print(settings_text(tuned))
    if out is not None:
        write_variant(tuned, out)
        print(f"# written to {out}")
