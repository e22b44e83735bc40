"""Commands for logs of real vehicles: import, inspect, and where their files are looked for."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gripbench.bench.commands import LOGS

if TYPE_CHECKING:
    from gripbench.bench.publishing.columns import Table
    from gripbench.bench.running.recorded import RecordedScore


RECORDING = "Name of a recording, folder of an imported one, or a map (TOML) beside its log."


def register(app: typer.Typer) -> None:
    """Add the commands to the application."""
    app.command("import", rich_help_panel=LOGS)(import_)
    data = typer.Typer(help="Files of published recordings.", no_args_is_help=True)
    data.command("path")(path)
    app.add_typer(data, name="data", rich_help_panel=LOGS)
    app.command("recordings", rich_help_panel=LOGS)(recordings)
    app.command("tune", rich_help_panel=LOGS)(tune)
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
    from gripbench.logs.channel_map import load_channel_map
    from gripbench.logs.importing import import_log
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
        typer.Argument(
            help="Published recordings, or folders of imported ones; by default all published."
        ),
    ] = None,
    method: Annotated[
        list[str] | None,
        typer.Option(help="name[:variant]; by default every built-in method."),
    ] = None,
    data: Annotated[
        Path | None, typer.Option(help="Folder of the files instead of the one that is set.")
    ] = None,
    by_excitation: Annotated[
        bool,
        typer.Option(
            "--by-excitation", help="One figure for each band of the utilisation of the tyres."
        ),
    ] = False,
    figures: Annotated[
        Path | None, typer.Option(help="Draw a picture of each recording into this folder.")
    ] = None,
    format: Annotated[
        str, typer.Option(help="terminal, text, markdown, csv, latex or html.")
    ] = "terminal",
) -> None:
    """Score methods and trivial estimators on recordings of real vehicles."""
    from gripbench.bench.publishing.figures.recordings import PICTURES, write_pictures
    from gripbench.bench.publishing.tables import show
    from gripbench.bench.running.recorded import score_published
    from gripbench.logs.published import recording_files

    scores = score_published(names or recording_files(), method or (), data, by_excitation)
    scored = [score for score in scores if score.status == "ok"]
    if scored:
        show(_table(scored), format)
    if figures is not None:
        drawn = sorted({score.recording for score in scored} & set(PICTURES))
        for path in write_pictures(drawn, figures, data):
            print(f"drawn: {path}", file=sys.stderr)
    left_out = {(score.estimator, score.reason): None for score in scores if score.status != "ok"}
    for estimator, reason in left_out:
        print(f"no figure: {estimator or 'recording'}: {reason}", file=sys.stderr)


def tune(
    recording: Annotated[str, typer.Argument(help=RECORDING)],
    method: Annotated[str, typer.Argument(help="name[:variant] of a built-in method.")],
    target: Annotated[str, typer.Option(help="Signal whose error counts.")] = "sideslip",
    draws: Annotated[int, typer.Option(min=1, help="Settings to try.")] = 60,
    out: Annotated[
        Path | None,
        typer.Option(help="Write the variant to this TOML file; run --method FILE.toml runs it."),
    ] = None,
    data: Annotated[
        Path | None, typer.Option(help="Folder of the files instead of the one that is set.")
    ] = None,
) -> None:
    """Tune a method on the training windows of a recording, over its parameters' ranges."""
    from gripbench.bench.running.tuning import settings_text, tune_recording, write_variant
    from gripbench.envs.signals import signal
    from gripbench.writing import check_writable

    if out is not None:
        check_writable(out)
    tuned = tune_recording(recording, method, target, draws, data)
    spans = ", ".join(f"{start:.3f} to {end:.3f} s" for start, end in tuned.windows)
    print(
        f"# {tuned.draws} trials, {target} on the training windows {spans}: RMS "
        f"{tuned.before:.3g} {signal(target).unit} before, {tuned.after:.3g} after"
    )
    if tuned.undetermined:
        print(f"# at an end of its range, so not settled: {', '.join(tuned.undetermined)}")
    print(settings_text(tuned))
    if out is not None:
        write_variant(tuned, out)
        print(f"# written to {out}")


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
    from gripbench.logs.biases import identify_biases
    from gripbench.logs.identification import (
        identify_steering,
        identify_tyres,
        with_velocity,
    )
    from gripbench.logs.identified_vehicles import (
        identified_vehicle,
        vehicle_of,
        write_vehicle,
    )
    from gripbench.logs.windows import windows_text

    imported = imported_of(recording, data)
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


def _table(scores: list[RecordedScore]) -> Table:
    from gripbench.bench.publishing.columns import Column, Table

    rows = [
        {
            "recording": score.recording,
            "target": score.target,
            "estimator": score.estimator,
            "kind": score.kind,
            "excitation": score.excitation,
            "measure": f"{score.measure} [{score.unit}]",
            "value": score.value,
            "interval": "–" if isnan(low) else f"{low:.3g} to {high:.3g}",
            "outside": score.outside,
        }
        for score in scores
        for low, high in [(score.low or 0.0, score.high or 0.0)]
    ]
    return Table(
        (
            Column("recording", "Recording"),
            Column("target", "Target"),
            Column("estimator", "Estimator"),
            Column("kind", "Kind"),
            *([Column("excitation", "Excitation")] if any(s.excitation for s in scores) else []),
            Column("measure", "Figure"),
            Column("value", "Value", format=".3g"),
            Column("interval", "95 % interval"),
            Column("outside", "Mean distance from what is known", format=".3g"),
        ),
        tuple(rows),
        caption="Methods and trivial estimators on the test windows of real recordings.",
        group_by="recording",
    )


def _print_inspection(log: Path, database: Sequence[str]) -> None:
    from rich.table import Table

    from gripbench.bench.publishing.presentation import console
    from gripbench.logs.inspection import inspect_log

    inspection = inspect_log(log, database)
    table = Table("column", "unit", "samples", "blank", "lowest", "highest")
    for column in inspection.columns:
        table.add_row(
            column.name,
            column.unit,
            str(column.samples),
            str(column.blanks),
            column.low,
            column.high,
        )
    console(stderr=True).print(table)
    for note in inspection.notes:
        print(f"note: {note}", file=sys.stderr)
    print(inspection.proposal, end="")
