"""`gripbench pack` and `gripbench verify`: a submission that others can trust."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gripbench.bench.commands import RANK
from gripbench.writing import DEFAULT_RESULTS


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command("pack", rich_help_panel=RANK)(pack)
    app.command("verify", rich_help_panel=RANK)(verify)


def pack(
    method: Annotated[str, typer.Argument(help="As for 'run --method', such as FILE.py:CLASS.")],
    to: Annotated[Path, typer.Option(help="File to write, such as my_method.zip.")],
    results: Annotated[Path, typer.Option(help="Folder of the stored rows.")] = DEFAULT_RESULTS,
) -> None:
    """Write one file with a method, its stored rows, its environment and their digests."""
    from gripbench.bench.publishing.terminal import console
    from gripbench.bench.running.packs import METHOD, ROWS, write_pack
    from gripbench.writing import check_writable

    check_writable(to)
    manifest = write_pack(method, results, to)
    own, rows = (
        sum(name.startswith(f"{folder}/") for name in manifest.files) for folder in (METHOD, ROWS)
    )
    console().print(
        f"wrote {to}: {manifest.label}, {rows} row{'s' if rows != 1 else ''} and {own} "
        f"file{'s' if own != 1 else ''} of the method; 'gripbench verify {to}' tries it",
        soft_wrap=True, markup=False, highlight=False,
    )  # fmt: skip


def verify(
    pack: Annotated[Path, typer.Argument(help="A file that 'gripbench pack' wrote.")],
    seeds: Annotated[int, typer.Option(help="Fresh drives of each scenario.")] = 20,
    scenario: Annotated[
        list[str] | None,
        typer.Option(help="Only this scenario, a name or its TOML file; repeat for more."),
    ] = None,
    workers: Annotated[int, typer.Option(min=0, help="Processes; 0: one a core.")] = 0,
    time_limit: Annotated[float, typer.Option(help="Seconds that one cell may take.")] = 60.0,
    memory_limit: Annotated[float, typer.Option(help="MiB that it may take.")] = 2048.0,
    sandbox: Annotated[
        str,
        typer.Option(
            envvar="GRIPBENCH_SANDBOX",
            help="bubblewrap: the method also has no network and cannot write.",
        ),
    ] = "",
    format_: Annotated[
        str, typer.Option("--format", help="terminal, text, markdown, csv, latex or html.")
    ] = "terminal",
) -> None:
    """Run a packed method again on drives that its author could not know; exit 1 if it differs."""
    import tempfile

    from gripbench.bench.publishing.tables import show
    from gripbench.bench.publishing.terminal import progress
    from gripbench.bench.publishing.verdicts import verdict_table, words
    from gripbench.bench.ranking.verification import verify as run_again
    from gripbench.bench.running.api import limits_of
    from gripbench.bench.running.backends import Backend
    from gripbench.bench.running.isolation.processes import choose_sandbox
    from gripbench.bench.running.packs import read_pack

    choose_sandbox(sandbox)
    limits = limits_of(time_limit, memory_limit)
    with tempfile.TemporaryDirectory(prefix="gripbench-verify-") as place:
        read = read_pack(pack, Path(place, "pack"))
        with progress("verifying", 1) as bar:
            task = bar.task_ids[0]
            verdict = run_again(
                read, Path(place, "fresh"), seeds, scenario or (), limits,
                Backend("loky", workers), lambda of: bar.update(task, advance=1, total=of),
            )  # fmt: skip
    show(verdict_table(read.manifest.label, verdict), format_)
    for line in words(read.manifest.label, verdict):
        print(line)
    if not verdict.verified:
        raise typer.Exit(1)
