"""Rows are written whole or not at all, damage is noticed, and old rows keep loading."""

import errno
import json
import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from gripbench import writing
from gripbench.bench.running import rows, store
from gripbench.bench.running.rows import Row, row_from
from gripbench.bench.running.store import (
    DamagedRowError,
    Store,
    leftovers,
    read_row,
    read_rows,
    seal,
)
from gripbench.bench.scoring.metric import Value, pooled_rms
from gripbench.errors import InputError

SAMPLES = Path(__file__).parent / "stored_rows"


def a_row(seed=0, **changes):
    score = {
        "rms": Value(value=0.1, total=1.0 / 3.0, count=33),
        "peak": Value(value=0.3),
        "convergence_time": Value(value=None),
    }
    content = {
        "key": "k",
        "scenario": "short",
        "seed": seed,
        "method": "rls",
        "label": "rls:paper@a=1.0",
        "targets": ("mu_front",),
        "status": "ok",
        "scores": {"mu_front": score},
    }
    return Row(**{**content, **changes})


def test_a_row_comes_back_as_it_was(tmp_path):
    place = Store(tmp_path)
    place.write(a_row(7))
    assert place.read("short", "rls:paper@a=1.0", 7) == a_row(7)
    assert place.read("short", "rls:paper@a=1.0", 8) is None
    assert list(place.read_all()) == [a_row(7)]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_truncation_or_changed_byte_is_noticed(tmp_path, data):
    path = tmp_path / "row.json"
    content = seal(a_row()).encode()
    at = data.draw(st.integers(0, len(content) - 1))
    if data.draw(st.booleans()):
        damaged = content[:at]
    else:
        damaged = content[:at] + bytes([content[at] ^ 0x15]) + content[at + 1 :]
    path.write_bytes(damaged)
    with pytest.raises(DamagedRowError):
        read_row(path)


def test_rows_of_the_first_schema_version_load():
    row = read_row(SAMPLES / "version_1.json")
    assert row is not None
    assert row.status == "ok"
    assert row.label == "slip_slope:paper"
    assert row.scores["mu_front"]["rms"].value == 0.0406759484869095
    failed = read_row(SAMPLES / "version_1_failed.json")
    assert failed is not None
    assert (failed.status, failed.targets) == ("timeout", ("mu_front",))
    assert row.schema_version == failed.schema_version == rows.SCHEMA_VERSION
    assert "excited_rms" not in row.scores["mu_front"]


def test_rows_of_the_second_schema_version_load():
    row = read_row(SAMPLES / "version_2.json")
    assert row is not None
    values = row.scores["mu"]
    old = json.loads((SAMPLES / "version_2.json").read_text())["row"]["scores"]["mu"]
    assert values["rms"].total == old["sum_of_squares"]
    assert values["rms"].value == old["rms"]
    assert values["bias"].value == old["bias"]
    assert values["rms_high"].total == old["by_utilisation"]["high"]["sum_of_squares"]
    assert values["friction_delay"].value == old["friction"]["delay"]
    assert values["jump_delay"].value == old["friction"]["jump_delay"]
    assert values["excited_rms"].count < values["rms"].count


def test_an_earlier_version_passes_through_every_step_to_the_present_one(monkeypatch):
    monkeypatch.setattr(rows, "SCHEMA_VERSION", 3)
    monkeypatch.setattr(
        rows,
        "_MIGRATIONS",
        {
            1: lambda content: {**content, "label": content["label"] + " two"},
            2: lambda content: {**content, "label": content["label"] + " three"},
        },
    )
    content = {**json.loads(a_row().model_dump_json()), "schema_version": 1}
    assert row_from(content, "here").label == "rls:paper@a=1.0 two three"


@pytest.mark.parametrize(
    ("version", "message"), [(99, "newer gripbench"), ("x", "not a row"), (0, "not a row")]
)
def test_a_version_that_cannot_be_read_is_said_so(version, message):
    content = {**json.loads(a_row().model_dump_json()), "schema_version": version}
    with pytest.raises(InputError, match=message):
        row_from(content, "here")


@pytest.mark.parametrize(
    ("code", "message"),
    [
        (errno.ENOSPC, "the disk is full"),
        (errno.EROFS, "read-only"),
        (errno.EACCES, "read-only"),
        (errno.EIO, "input/output error"),
    ],
)
def test_what_cannot_be_written_is_one_error_and_the_old_row_stays(
    tmp_path, monkeypatch, code, message
):
    place = Store(tmp_path)
    place.write(a_row())

    def fail(path, data):
        path.write_bytes(data[:40])
        raise OSError(code, __import__("os").strerror(code))

    monkeypatch.setattr(writing, "_write", fail)
    with pytest.raises(InputError, match=message):
        place.write(a_row(reason="new"))
    assert list(place.read_all()) == [a_row()]
    assert leftovers(tmp_path) == []


def test_a_results_folder_that_is_a_file_is_one_error(tmp_path):
    (tmp_path / "results").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        Store(tmp_path / "results").write(a_row())


def test_a_failed_row_has_a_line_for_each_of_its_targets(tmp_path):
    place = Store(tmp_path)
    place.write(a_row())
    place.write(
        a_row(1, status="timeout", reason="slow", scores={}, targets=("mu_front", "mu_rear"))
    )
    frame = read_rows(tmp_path)
    assert list(frame["target"]) == ["mu_front", "mu_front", "mu_rear"]
    assert list(frame["status"]) == ["ok", "timeout", "timeout"]
    assert list(frame["rms"].isna()) == [False, True, True]
    assert list(frame["count"]) == [33, 0, 0]


def test_rms_is_pooled_by_squares_not_by_its_mean():
    assert pooled_rms([1.0 * 10, 9.0 * 30], [10, 30]) == pytest.approx((280 / 40) ** 0.5)
    assert pooled_rms([1.0 * 10, 9.0 * 30], [10, 30]) != pytest.approx((1.0 + 3.0) / 2)


def test_names_of_files_are_possible_everywhere_and_differ(tmp_path):
    labels = [
        "slip_slope:paper",
        "a@b=1.0",
        "con",
        "nul",
        "x",
        "a" * 300 + "@b=1",
        "a" * 300 + "@b=2",
    ]
    paths = [
        Store(tmp_path).path(name, label, 0) for name in ("recording:x", "s@1") for label in labels
    ]
    for path in paths:
        for part in path.relative_to(tmp_path).parts:
            assert not set(part) & set('<>:"/\\|?*')
            assert part.upper() not in {"CON", "NUL", "AUX"}
            assert len(part) < 220
    assert len(set(paths)) == len(paths)


def test_rows_under_the_names_of_earlier_versions_load_and_move(tmp_path):
    place = Store(tmp_path)
    old = tmp_path / "rows" / "recording:x" / "rls:paper%40a%3D1.0" / "3.json"
    old.parent.mkdir(parents=True)
    row = a_row(3, scenario="recording:x")
    old.write_text(seal(row))
    assert place.read("recording:x", row.label, 3) == row
    assert list(place.read_all(("recording:x",), (row.label,))) == [row]
    changed = row.model_copy(update={"reason": "new"})
    place.write(changed)
    assert not old.exists()
    assert list(place.read_all()) == [changed]


ODD = [
    "[]", "null", "7", "{}", '{"schema_version": 1}', '{"schema_version": true}', "[" * 100_000,
    '{"schema_version": 1e400}', '{"schema_version": ' + "9" * 5000 + "}", "{", "NaN",
    '{"schema_version": 2, "key": [], "scenario": {}, "seed": -1}',
]  # fmt: skip


@pytest.mark.parametrize("body", ODD)
def test_a_right_checksum_of_odd_content_is_a_damaged_row(tmp_path, body):
    path = tmp_path / "0.json"
    path.write_text(f'{{"checksum": "{store._digest(body)}", "row": {body}}}\n')
    with pytest.raises(DamagedRowError):
        read_row(path)


def test_files_of_others_are_not_looked_at_and_a_copy_is_not_counted_twice(tmp_path, capsys):
    place = Store(tmp_path)
    place.write(a_row(9))
    folder = place.path("short", "rls:paper@a=1.0", 9).parent
    text = (folder / "9.json").read_text()
    for name in ("9 copy.json", "0x.json", "09.json", "\u0669.json", "notes.txt", "9.json.bak"):
        (folder / name).write_text(text)
    os.mkfifo(folder / "4.json")
    (folder / "5.json").mkdir()
    (tmp_path / "rows" / "loose.json").write_text("x")
    os.mkfifo(tmp_path / "rows" / "short" / "pipe")
    assert list(place.read_all()) == [a_row(9)]
    assert capsys.readouterr().err == ""
    (folder / "7.json").write_text(text)
    assert list(place.read_all()) == [a_row(9)]
    assert "7.json: damaged or no row of its place, left out" in capsys.readouterr().err
    with pytest.raises(DamagedRowError, match="of another cell"):
        place.read("short", "rls:paper@a=1.0", 7)
    assert place.read("short", "rls:paper@a=1.0", 4) is None


@given(title=st.text(st.characters(codec=None)), reason=st.text(st.characters(codec=None)))
@example(title="\udc80", reason="two\nlines\x00\x1b[31m\u202e")
@example(title="x" * 5000, reason="\ud800" * 5000)
def test_any_words_can_be_stored_and_stay_on_one_line(title, reason):
    row = a_row(title=title, reason=reason, parameters={"mode": title})
    text = seal(row)
    back = row_from(json.loads(text)["row"], "here")
    assert back == row
    assert len(text.splitlines()) == 1
    assert len(text) < 25_000
    for words in (back.title, back.reason):
        # spaces of every kind stay; what breaks, hides or turns a line does not
        assert all(letter.isprintable() or letter.isspace() for letter in words)
        assert len(words.splitlines()) <= 1
    if title.isascii() and title.isprintable() and len(title) < 100:
        assert back.title == title
