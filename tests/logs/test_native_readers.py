"""Compiled libraries read in a process of their own: whatever they do is one line."""

import os
import signal
import zlib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from gripbench.errors import InputError
from gripbench.logs.mapping.map_tables import LogFile
from gripbench.logs.readers import reader_process
from gripbench.logs.readers.reading import read_log

DBC = (
    'VERSION ""\nNS_ :\nBS_:\nBU_: ECU\nBO_ 256 M: 8 ECU\n'
    ' SG_ YawRate : 0|16@1- (0.01,0) [0|0] "deg/s" ECU\n'
)


def _write(folder: Path, suffix: str) -> Path:
    path = folder / f"log.{suffix}"
    t, r = np.arange(200) * 0.01, np.sin(np.arange(200) * 0.05)
    if suffix == "parquet":
        pd.DataFrame({"t": t, "r": r}).to_parquet(path)
    elif suffix == "mat":
        savemat(path, {"t": t, "r": r}, do_compression=True)
    elif suffix == "mf4":
        asammdf = pytest.importorskip("asammdf")
        with asammdf.MDF(version="4.10") as mdf:
            mdf.append([asammdf.Signal(r, t, name="r", unit="rad/s")])
            mdf.save(path, overwrite=True)
    else:
        can = pytest.importorskip("can")
        (folder / "car.dbc").write_text(DBC)
        with can.Logger(str(path)) as writer:
            for k in range(200):
                data = int(1000 * r[k]).to_bytes(2, "little", signed=True) + bytes(6)
                writer.on_message_received(
                    can.Message(timestamp=1.0 + t[k], arbitration_id=256, data=data,
                                is_extended_id=False)
                )  # fmt: skip
    return path


@pytest.mark.parametrize("suffix", ["mat", "mf4", "blf", "parquet"])
def test_flipped_bytes_bring_one_line_or_a_log(tmp_path, suffix):
    path = _write(tmp_path, suffix)
    file = LogFile(path=path.name, database="car.dbc" if suffix == "blf" else "")
    whole = read_log(path, file)
    content = path.read_bytes()
    rng = np.random.default_rng(2)
    outcomes = []
    for _ in range(40):
        damaged = bytearray(content)
        for place in rng.integers(0, len(content), 3):
            damaged[place] ^= int(rng.integers(1, 256))
        path.write_bytes(bytes(damaged))
        try:
            found = read_log(path, file)
        except InputError as error:
            outcomes.append(str(error))
        else:
            assert all(column.values is not None for column in found.columns.values())
    assert outcomes
    assert all("\n" not in text and path.name in text for text in outcomes)
    path.write_bytes(content)  # what came before leaves nothing behind
    again = read_log(path, file)
    for name, column in whole.columns.items():
        np.testing.assert_array_equal(again.columns[name].values, column.values)


class _Reader:
    """A stand-in for a format's module, found by the reading process under its name."""

    def __init__(self, monkeypatch, tmp_path, body):
        package = Path(reader_process.__file__).parent
        # The process that reads keeps the modules that it has seen: each gets its own name.
        name = f"stand_in_{os.getpid()}_{zlib.crc32(body.encode())}_files"
        self.path = package / f"{name}.py"
        self.path.write_text(
            f"import os, signal, time\ndef read(path, file, wanted):\n    {body}\n"
        )
        self.name = name

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.path.unlink()

    def read(self, path):
        return reader_process.read_apart(self.name, path, {"path": path.name}, None)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("os.kill(os.getpid(), signal.SIGSEGV)", r"log\.bin.*died \(SIGSEGV\).*damaged"),
        ("os._exit(3)", r"log\.bin.*died \(exit code 3\)"),
        ("time.sleep(60)", r"log\.bin.*longer than 1 s"),
    ],
)
@pytest.mark.skipif(not hasattr(os, "fork"), reason="the system cannot fork")
def test_a_library_that_dies_or_hangs_is_one_line(tmp_path, monkeypatch, body, message):
    monkeypatch.setattr(reader_process, "_SECONDS", 1.0)
    path = tmp_path / "log.bin"
    path.write_bytes(b"x")
    with _Reader(monkeypatch, tmp_path, body) as reader, pytest.raises(InputError, match=message):
        reader.read(path)
    assert read_log(_write(tmp_path, "mat")).names == ("t", "r")


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the system cannot fork")
def test_a_library_that_takes_too_much_memory_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(reader_process, "_MEMORY", 200 << 20)
    path = tmp_path / "log.bin"
    path.write_bytes(b"x")
    with _Reader(monkeypatch, tmp_path, "bytearray(1 << 30)") as reader, pytest.raises(MemoryError):
        reader.read(path)


def test_a_file_beside_the_current_folder_does_not_run(tmp_path, monkeypatch):
    (tmp_path / "scipy.py").write_text("raise SystemExit('hijacked')")
    (tmp_path / "json.py").write_text("raise SystemExit('hijacked')")
    path = _write(tmp_path, "mat")
    monkeypatch.chdir(tmp_path)
    reader_process._SERVER._end()
    assert read_log(Path(path.name)).names == ("t", "r")


def test_the_reading_process_is_gone_when_it_is_killed_and_comes_again(tmp_path):
    path = _write(tmp_path, "mat")
    read_log(path)
    process = reader_process._SERVER._process
    assert process is not None
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert read_log(path).names == ("t", "r")
