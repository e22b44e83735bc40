"""CAN frames are known by channel, form and identifier; traces of every tool are read."""

import base64

import numpy as np
import pytest

from gripbench.errors import InputError
from gripbench.logs.importing import import_log
from gripbench.logs.mapping.inspection import inspect_log
from gripbench.logs.mapping.map_tables import LogFile
from gripbench.logs.readers.reading import read_log

can = pytest.importorskip("can", reason="the extra 'logs' is not installed")
pytest.importorskip("cantools", reason="the extra 'logs' is not installed")

DBC = """VERSION ""
NS_ :
BS_:
BU_: ECU
BO_ 256 ESP: 8 ECU
 SG_ YawRate : 0|16@1- (0.01,0) [0|0] "deg/s" ECU
 SG_ Quality : 16|8@1+ (1,0) [0|0] "" ECU
BO_ 257 LWI: 8 ECU
 SG_ SteerAngle : 0|15@1+ (0.1,0) [0|0] "deg" ECU
 SG_ SteerSign : 15|1@1+ (1,0) [0|0] "" ECU
 SG_ SteerValid : 16|1@1+ (1,0) [0|0] "" ECU
BO_ 2364540158 EEC1: 8 ECU
 SG_ EngSpeed : 24|16@1+ (0.125,0) [0|8031.875] "rpm" ECU
VAL_ 256 Quality 255 "SNA" 0 "ok" ;
"""
OTHER = DBC.replace("0.01,0", "0.02,0").replace(" ESP:", " ESP2:")
COUNT = 60


def _message(k, identifier=256, value=None, **more):
    raw = int(100 * value) if value is not None else 10 * k
    data = raw.to_bytes(2, "little", signed=True) + bytes([255 if k % 7 == 3 else 0]) + bytes(5)
    return can.Message(
        timestamp=100.0 + 0.01 * k, arbitration_id=identifier,
        data=more.pop("data", data), **({"is_extended_id": False} | more),
    )  # fmt: skip


def _write(folder, messages, suffix="blf"):
    (folder / "car.dbc").write_text(DBC)
    (folder / "other.dbc").write_text(OTHER)
    path = folder / f"trace.{suffix}"
    with can.Logger(str(path)) as writer:
        for message in messages:
            writer.on_message_received(message)
    return path


def _read(path, database="car.dbc"):
    return read_log(path, LogFile(path=path.name, database=database))


def test_one_identifier_on_two_channels_is_never_merged(tmp_path):
    messages = [m for k in range(COUNT) for m in (_message(k, channel=0), _message(
        k, value=-0.1 * k, channel=1))]  # fmt: skip
    path = _write(tmp_path, messages)
    log = _read(path)
    np.testing.assert_allclose(log.numbers("0:ESP.YawRate", "x"), 0.1 * np.arange(COUNT))
    np.testing.assert_allclose(log.numbers("1:ESP.YawRate", "x"), -0.1 * np.arange(COUNT))
    with pytest.raises(InputError, match=r"two columns.*'0:ESP.YawRate', '1:ESP.YawRate'"):
        log.column("ESP.YawRate", "x")
    (tmp_path / "map.toml").write_text(inspect_log(path, str(tmp_path / "car.dbc")).proposal)
    seen = import_log(path, tmp_path / "map.toml").recordings[0].observations["yaw_rate"]
    np.testing.assert_allclose(np.rad2deg(seen), 0.1 * np.arange(COUNT), atol=1e-9)


def test_each_channel_may_have_its_own_database(tmp_path):
    messages = [m for k in range(COUNT) for m in (_message(k, channel=0), _message(k, channel=1))]
    log = _read(_write(tmp_path, messages), ["0=car.dbc", "1=other.dbc"])
    np.testing.assert_allclose(log.numbers("ESP.YawRate", "x"), 0.1 * np.arange(COUNT))
    np.testing.assert_allclose(log.numbers("ESP2.YawRate", "x"), 0.2 * np.arange(COUNT))


def test_an_extended_frame_is_another_message(tmp_path):
    messages = [m for k in range(COUNT) for m in (_message(k), _message(
        k, value=-1.0, is_extended_id=True))]  # fmt: skip
    log = _read(_write(tmp_path, messages))
    np.testing.assert_allclose(log.numbers("ESP.YawRate", "x"), 0.1 * np.arange(COUNT))


def test_j1939_is_known_by_its_group_and_marks_what_is_not_available(tmp_path):
    data = bytes.fromhex("f07d859b0fffff85")
    blank = bytes.fromhex("f07d85ffffffff85")
    messages = [
        _message(k, 0x0CF00400, data=blank if k == 5 else data, is_extended_id=True)
        for k in range(COUNT)
    ]
    values = _read(_write(tmp_path, messages)).numbers("EEC1.EngSpeed", "x")
    assert np.isnan(values[5])
    np.testing.assert_allclose(np.delete(values, 5), 499.375)


def test_words_of_the_database_that_mean_nothing_are_blanks(tmp_path):
    values = _read(_write(tmp_path, [_message(k) for k in range(COUNT)])).numbers(
        "ESP.Quality", "x"
    )
    np.testing.assert_array_equal(np.isnan(values), np.arange(COUNT) % 7 == 3)


def test_magnitude_sign_and_validity_make_one_angle(tmp_path):
    truth = 30.0 * np.sin(0.3 * np.arange(COUNT))
    messages = []
    for k, angle in enumerate(truth):
        raw = round(abs(angle) * 10) | (0x8000 if angle < 0 else 0)
        data = raw.to_bytes(2, "little") + bytes([0 if k == 9 else 1]) + bytes(5)
        messages.append(_message(k, 257, data=data))
    path = _write(tmp_path, messages)
    (tmp_path / "map.toml").write_text(inspect_log(path, str(tmp_path / "car.dbc")).proposal)
    seen = import_log(path, tmp_path / "map.toml").recordings[0].observations["steer_angle"]
    np.testing.assert_allclose(np.rad2deg(seen) * 16.0, np.delete(np.round(truth, 1), 9), atol=1e-9)


def test_mf4_bus_logs_are_decoded(tmp_path):
    pytest.importorskip("asammdf")
    path = _write(tmp_path, [_message(k) for k in range(COUNT)], "mf4")
    log = _read(path)
    np.testing.assert_allclose(log.numbers("ESP.YawRate", "x"), 0.1 * np.arange(COUNT))
    with pytest.raises(InputError, match="key 'database'"):
        read_log(path)


HEX = [(10 * k).to_bytes(2, "little").hex().upper() + 12 * "0" for k in range(COUNT)]
SPACED = [" ".join(h[i : i + 2] for i in range(0, 16, 2)) for h in HEX]
ASC = "date Mon Dec 6 11:21:13 am 2021\nbase hex  timestamps absolute\n"
TEXTS = {
    "end.asc": ASC + "".join(f" {0.01 * k:.6f} 1  100   Rx   d 8 {s}\n" for k, s in
                             enumerate(SPACED)) + "End TriggerBlock\n",
    "no_end.asc": ASC + "".join(f" {0.01 * k:.6f} 1  100   Rx   d 8 {s}\n" for k, s in
                                enumerate(SPACED)),
    "negative.asc": ASC + "".join(f" {0.01 * k - 0.2:.6f} 1  100   Rx   d 8 {s}\n" for k, s in
                                  enumerate(SPACED)),
    "relative.asc": ASC.replace("absolute", "relative") + "".join(
        f" {0.01 if k else 0:.6f} 1  100   Tx   d 8 {s}\n" for k, s in enumerate(SPACED)),
    "flexible.asc": ASC + "".join(
        f" {0.01 * k:.6f} CANFD 1 Rx 100 Name 1 0 8 8 {s} 0 0 0\n" for k, s in
        enumerate(SPACED)),
    "candump.log": "".join(f"({5.0 + 0.01 * k:.6f}) can0 100#{h} R\n" for k, h in enumerate(HEX)),
    "screen.log": "".join(f" ({5.0 + 0.01 * k:.6f})  can0  100   [8]  {s}\n" for k, s in
                          enumerate(SPACED)),
    "python-can.csv": "timestamp,arbitration_id,extended,remote,error,dlc,data\n" + "".join(
        f"np.float64({5.0 + 0.01 * k:.2f}),0x100,0,0,0,8,"
        f"{base64.b64encode(bytes.fromhex(h)).decode()}\n" for k, h in enumerate(HEX)),
    "savvycan.csv": "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n" + "".join(
        f"{10000 * k},00000100,false,Rx,0,8,{s.replace(' ', ',')},\n" for k, s in
        enumerate(SPACED)),
}  # fmt: skip


@pytest.mark.parametrize("name", TEXTS)
def test_traces_of_every_tool(tmp_path, name):
    (tmp_path / "car.dbc").write_text(DBC)
    path = tmp_path / name
    path.write_text(TEXTS[name])
    column = _read(path).column("ESP.YawRate", "x")
    np.testing.assert_allclose(column.values, 0.1 * np.arange(COUNT))
    np.testing.assert_allclose(np.diff(column.times), 0.01, atol=1e-9)
    if name == "negative.asc":
        assert column.times[0] == pytest.approx(-0.2)


def test_peak_traces(tmp_path):
    path = _write(tmp_path, [_message(k) for k in range(COUNT)], "trc")
    np.testing.assert_allclose(_read(path).numbers("ESP.YawRate", "x"), 0.1 * np.arange(COUNT))
