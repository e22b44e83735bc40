"""`gripbench plot`: truth and estimates of a signal over one run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gripbench.bench.commands import RUN
from gripbench.writing import DEFAULT_RESULTS


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("plot", rich_help_panel=RUN)(plot)


def plot(
    scenario: Annotated[
        str, typer.Argument(help="A scenario's name or TOML file, or recording:PLACE.")
    ],
    methods: Annotated[
        str,
        typer.Option(
            help="NAME[:VARIANT] or FILE.py:CLASS, several with commas between. "
            "None: the truth alone."
        ),
    ] = "",
    signal: Annotated[
        str,
        typer.Option(
            help="What to draw, such as mu_front or sideslip; by default what the methods estimate."
        ),
    ] = "",
    seed: Annotated[int, typer.Option(min=0, help="Seed of the run.")] = 0,
    start: Annotated[float | None, typer.Option(help=r"From this time \[s].")] = None,
    end: Annotated[float | None, typer.Option(help=r"Up to this time \[s].")] = None,
    output: Annotated[
        Path | None, typer.Option(help="File name without suffix; by default under RESULTS/plots.")
    ] = None,
    results: Annotated[Path, typer.Option(help="Folder of results.")] = DEFAULT_RESULTS,
    draw: Annotated[
        str,
        typer.Option(
            help="run: truth, estimates and errors of one run. reliability, nees: what methods "
            "state of their errors, over many runs."
        ),
    ] = "run",
    seeds: Annotated[
        int, typer.Option(min=1, help="Runs that reliability and nees are taken over.")
    ] = 20,
    known: Annotated[
        bool,
        typer.Option(
            "--known",
            help="Shade where the sensors of these methods together cannot tell the signal (see "
            "'gripbench bound'), and print each RMS error where they can.",
        ),
    ] = False,
    dpi: Annotated[int, typer.Option(min=30, max=1200, help="Dots an inch of the PNG.")] = 150,
) -> None:
    """Draw a signal of one run, or what methods state of their errors in it, as PNG and PDF."""
    from gripbench.bench.publishing.figures.calibration import nees_plot, reliability_plot
    from gripbench.bench.publishing.figures.known_errors import knowable_errors
    from gripbench.bench.publishing.figures.run_plot import run_plot, usual_signal
    from gripbench.bench.publishing.figures.runs import Runs
    from gripbench.bench.publishing.figures.style import save, style
    from gripbench.errors import InputError, unknown
    from gripbench.writing import check_writable

    over_runs = {"reliability": reliability_plot, "nees": nees_plot}
    if draw != "run" and draw not in over_runs:
        raise unknown("picture", draw, ("run", *over_runs))
    chosen = split_methods(methods)
    if draw != "run" and not chosen:
        raise InputError(f"--draw {draw} needs --methods: name those whose errors are judged")
    runs = Runs()
    signal = signal or usual_signal(runs, scenario, chosen, seed)
    if output is None:
        what = seed if draw == "run" else draw
        output = results / "plots" / f"{Path(scenario).stem}_{signal}_{what}"
    check_writable(output.parent / f"{output.name}.png")
    bound = None
    if known:
        bound, lines = knowable_errors(runs, scenario, chosen, signal, seed)
        typer.echo("\n".join(lines))
    with style():
        if draw == "run":
            figure = run_plot(runs, scenario, chosen, signal, seed, start, end, bound)
        else:
            figure = over_runs[draw](runs, scenario, chosen, signal, seeds)
        paths = save(figure, output.parent, output.name.removesuffix(".png"), dpi)
    typer.echo("Written: " + ", ".join(str(path) for path in paths))


def split_methods(text: str) -> list[str]:
    """Return the methods in a text with commas between them; their own settings have commas too.

    Examples
    --------
    >>> split_methods("slip_slope@forgetting=0.99,a_filter_setting=2, proposed_observer")
    ['slip_slope@forgetting=0.99,a_filter_setting=2', 'proposed_observer']
    """
    found: list[str] = []
    for part in filter(None, (part.strip() for part in text.split(","))):
        if "=" in part and "@" not in part and found:
            found[-1] += f",{part}"
        else:
            found.append(part)
    return found
