"""Commands for logs of real vehicles: import, inspect, and where their files are looked for."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from gripbench.bench.commands import LOGS
from gripbench.writing import DEFAULT_RESULTS

RECORDING = "Name of a recording, folder of an imported one, or a map (TOML) beside its log."


def register(app: typer.Typer) -> None:
    """Add the commands to the application."""
    app.command("import", rich_help_panel=LOGS)(import_)
    data = typer.Typer(help="Files of published recordings.", no_args_is_help=True)
    data.command("path")(path)
    app.add_typer(data, name="data", rich_help_panel=LOGS)
    app.command("recordings", rich_help_panel=LOGS)(recordings)
    app.command("identify", rich_help_panel=LOGS)(identify)


def import_(
    log: Annotated[Path, typer.Argument(help="The log, or the folder with a map's files.")],
    channel_map: Annotated[
        Path | None, typer.Option("--map", help="TOML file that says which column is what.")
    ] = None,
    inspect: Annotated[
        bool, typer.Option("--inspect", help="List what is in the log and propose a map.")
    ] = False,
    database: Annotated[
        list[str] | None,
        typer.Option(
            help="DBC file of CAN frames, for --inspect; repeatable; CHANNEL=FILE for one bus."
        ),
    ] = None,
    out: Annotated[
        Path, typer.Option(help="Folder in which the recording gets a folder of its name.")
    ] = Path("recordings"),
) -> None:
    """Import a log of a real vehicle as a recording, and report its quality."""
    from gripbench.errors import InputError
    from gripbench.logs.importing import import_log
    from gripbench.logs.mapping.channel_map import load_channel_map
    from gripbench.logs.storing import store

    if inspect:
        _print_inspection(log, database or ())
        return
    if channel_map is None:
        raise InputError("import needs --map MAP.toml; --inspect proposes one")
    name = load_channel_map(channel_map).name
    imported = import_log(log, channel_map)
    folder = store(imported, out / name)
    print(imported.report.text())
    for recording in imported.recordings:
        seen = recording.observations
        print(
            f"{recording.scenario} run {recording.seed}: {len(seen)} rows over "
            f"{seen['time'][-1]:.3f} s, "
            f"{len([n for n in seen.dtype.names or () if not n.endswith('_new')]) - 1} channels"
        )
    print(f"stored in {folder}")


def path(
    folder: Annotated[
        Path | None, typer.Option(help="A folder instead of the one that is set.")
    ] = None,
) -> None:
    """Print where the files of published recordings are looked for."""
    from gripbench.logs.locations import VARIABLE, data_folder

    chosen = data_folder(folder)
    print(chosen)
    if not chosen.is_dir():
        print(f"(no such folder; set {VARIABLE} to the one that has the files)")


def recordings(
    names: Annotated[
        list[str] | None,
        typer.Argument(help=f"{RECORDING} By default all published ones."),
    ] = None,
    method: Annotated[
        list[str] | None,
        typer.Option(help="name[:variant]; by default all built-in ones that the log can run."),
    ] = None,
    data: Annotated[
        Path | None, typer.Option(help="Folder of the files instead of the one that is set.")
    ] = None,
    wide: Annotated[
        bool, typer.Option("--wide", help="With every metric: also by utilisation of the tyres.")
    ] = False,
    figures: Annotated[
        Path | None, typer.Option(help="Draw a picture of each recording into this folder.")
    ] = None,
    workers: Annotated[int, typer.Option(min=0, help="Processes; 0: one a core.")] = 0,
    results: Annotated[Path, typer.Option(help="Folder of the stored rows.")] = DEFAULT_RESULTS,
    format: Annotated[
        str, typer.Option(help="terminal, text, markdown, csv, latex or html.")
    ] = "terminal",
) -> None:
    """Run methods and baselines on recordings and rank them: `run` and `rank` in one command."""
    import pandas as pd

    from gripbench.bench.commands.rank import show_boards
    from gripbench.bench.publishing.figures.recordings import PICTURES, write_pictures
    from gripbench.bench.publishing.leaderboard import usual_targets
    from gripbench.bench.publishing.presentation import print_failures
    from gripbench.bench.ranking.ranking import boards
    from gripbench.bench.running.api import run
    from gripbench.bench.running.recorded_scenarios import PREFIX, recorded_scenario
    from gripbench.logs.locations import use_data_folder

    use_data_folder(data)
    more: dict[str, Any] = {"methods": method or (), "results": results, "workers": workers}
    parts = [] if names else [run("recordings", **more)]
    for scenario in map(recorded_scenario, names or ()):
        if scenario.absent:
            print(scenario.absent, file=sys.stderr)
        else:
            parts.append(run(scenarios=[scenario], **more))
    if not parts:
        return
    frame = pd.concat(parts, ignore_index=True)
    found = []
    for _, part in frame[frame["status"] != "skipped"].groupby("scenario", sort=False):
        found += boards(part, usual_targets(part) or (), "any")
    show_boards(found, format, wide)
    if figures is not None:
        drawn = {name.removeprefix(PREFIX) for board in found for name in board.scenarios}
        for path in write_pictures(sorted(drawn & set(PICTURES)), figures):
            print(f"drawn: {path}", file=sys.stderr)
    print_failures(frame, stderr=True)


def identify(
    recording: Annotated[str, typer.Argument(help=RECORDING)],
    steering: Annotated[
        bool, typer.Option(help="Fit the steering's scale and offset with the tyres.")
    ] = True,
    friction: Annotated[
        float | None,
        typer.Option(min=0.05, max=2.0, help="Friction to take as known instead of fitting it."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Write the vehicle with the tyres found to this file.")
    ] = None,
    data: Annotated[
        Path | None, typer.Option(help="Folder of the files instead of the one that is set.")
    ] = None,
) -> None:
    """Identify tyres, or without a velocity reference the steering, and sensor biases."""
    from gripbench.bench.running.recorded_logs import imported_of
    from gripbench.envs.signals import signal
    from gripbench.errors import InputError
    from gripbench.logs.locations import use_data_folder
    from gripbench.logs.vehicle.biases import identify_biases
    from gripbench.logs.vehicle.identification import (
        identify_steering,
        identify_tyres,
        with_velocity,
    )
    from gripbench.logs.vehicle.identified_vehicles import (
        identified_vehicle,
        vehicle_of,
        write_vehicle,
    )
    from gripbench.logs.windows import windows_text

    use_data_folder(data)
    imported = imported_of(recording)
    runs = imported.recordings
    with_tyres = with_velocity(runs)
    if out is not None and not with_tyres:
        raise InputError(f"{recording}: without a velocity reference no tyres are identified")
    if with_tyres:
        found = identify_tyres(runs, steering, friction)
    else:
        column = imported.provenance.channel_map.get("channels", {}).get("steer_angle", {})
        divisor = runs[0].vehicle[column["per"]] if column.get("per") else 1.0
        found = identify_steering(runs, column.get("scale", 1.0) / divisor)
    print(windows_text(runs))
    for name, value in found.values.items():
        print(f"{name:20} {value:10.4g}  standard deviation {found.deviations[name]:.2g}")
    unseen = "" if found.test_rms is None else f", on the test windows {found.test_rms:.3g}"
    print(f"unexplained RMS on the training windows {found.train_rms:.3g}{unseen} {found.unit}")
    if (spread := found.undetermined()) is not None:
        print(spread)
    try:
        biases = identify_biases(runs)
    except InputError as error:
        print(f"biases undetermined: {error}")
        biases = []
    for bias in biases:
        name = f"{bias.channel} bias"
        unseen = "" if bias.test_rms is None else f"; on test blocks {bias.test_rms:.2g}"
        print(
            f"{name:20} {bias.value:10.4g}  standard deviation {bias.deviation:.2g} "
            f"{signal(bias.channel).unit}, from {bias.blocks} blocks in {bias.found_from}{unseen}"
        )
    if out is not None:
        vehicle = vehicle_of(imported.provenance.channel_map, runs[0])
        write_vehicle(identified_vehicle(vehicle, found, runs[0].scenario), out)
        print(f"written to {out}")


def _print_inspection(log: Path, database: Sequence[str]) -> None:
    from gripbench.bench.publishing.columns import Table
    from gripbench.bench.publishing.tables import show
    from gripbench.logs.mapping.inspection import inspect_log

    inspection = inspect_log(log, database)
    headings = ("column", "unit", "samples", "blank", "lowest", "highest")
    lines = [
        (one.name, one.unit, str(one.samples), str(one.blanks), one.low, one.high)
        for one in inspection.columns
    ]
    show(Table.of_texts(headings, lines), stderr=True)
    for note in (*inspection.notes, *_what_would_run(log, inspection.proposal)):
        print(f"note: {note}", file=sys.stderr)
    print(inspection.proposal, end="")


def _what_would_run(log: Path, proposal: str) -> list[str]:
    """Return what a log with the proposed map can run, and the keys that more would need."""
    import tomllib

    from gripbench.bench.running.forms import what_would_run
    from gripbench.configuration import parse
    from gripbench.errors import InputError
    from gripbench.logs.importing import import_log
    from gripbench.logs.mapping.channel_map import ChannelMap

    try:
        imported = import_log(log, parse(ChannelMap, tomllib.loads(proposal), "the proposed map"))
    except InputError as error:
        return [f"not to be imported before it is completed: {error}"]
    first = imported.recordings[0]
    known = [name for name in first.truth.dtype.names or () if name != "time"]
    targets = [name for name in known if not name.endswith("_new")]
    if not targets:
        return ["no column was found for a reference ([reference.sideslip] and others): no scores"]
    return what_would_run(first, targets)
