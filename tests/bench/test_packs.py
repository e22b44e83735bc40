"""A pack holds all that its rows rest on; what was changed in it, or is none, is one line."""

import json
import shutil
import stat
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import gripbench
from gripbench.bench.command_line import application
from gripbench.bench.ranking.verification import CONFIDENCE, difference_of, verify
from gripbench.bench.running import packs
from gripbench.bench.running.backends import Backend
from gripbench.bench.running.packs import read_pack, write_pack
from gripbench.bench.running.store import Store
from gripbench.envs.hidden_draws import drawn_with, salt
from gripbench.errors import InputError

KINDS = Path(__file__).parents[1] / "plugins" / "kinds"
SCENARIO = "constant_mu@1"
MINE = """
import numpy as np
import gain

TABLE = np.loadtxt(__file__.replace("mine.py", "table.txt"))

class Mine:
    name = "mine"
    sensors = ("accel_x",)
    estimates = ("mu_front",)
    files = ("table.txt",)

    def __init__(self, share=0.5):
        self.share = share

    def reset(self, vehicle, dt):
        self.value = gain.GAIN * float(TABLE)

    def update(self, obs):
        self.value += 1e-3 * (self.share * abs(obs["accel_x"]) - self.value)
        return {"mu_front": self.value}
"""


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    """Path of a scenario of .2 s that is drawn from a population."""
    path = tmp_path_factory.mktemp("scenario") / "brief.toml"
    text = (gripbench.configuration.CONFIGS / "scenarios" / "constant_mu.toml").read_text()
    text = text.replace('name = "constant_mu"', 'name = "brief"', 1)
    path.write_text(text.replace("horizon = 30.0", "horizon = 0.2", 1))
    return f"{path}@1"


@pytest.fixture(scope="module")
def packed(tmp_path_factory, scenario):
    """A pack of a method with a module and a file of its own, and its folder."""
    folder = tmp_path_factory.mktemp("packed")
    (folder / "mine.py").write_text(MINE)
    (folder / "gain.py").write_text("GAIN = 2.0\n")
    (folder / "table.txt").write_text("0.25\n")
    method = f"{folder / 'mine.py'}:Mine@share=0.4"
    gripbench.run(
        scenarios=[scenario], methods=[method], seeds=6, results=folder / "results", workers=1
    )
    write_pack(method, folder / "results", folder / "mine.zip")
    return folder / "mine.zip"


def _verified(path, scenario, folder, seeds=4):
    read = read_pack(path, folder / "pack")
    return verify(read, folder / "fresh", seeds, [scenario], backend=Backend("loky", 1))


def _changed(packed, folder, change, fix_digests=False):
    """Return a copy of a pack whose content a function has changed, with right digests or not."""
    import hashlib

    with zipfile.ZipFile(packed) as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    change(content)
    if fix_digests:
        said = json.loads(content[packs.MANIFEST])
        said["files"] = {
            name: hashlib.sha256(data).hexdigest()
            for name, data in content.items() if name != packs.MANIFEST
        }  # fmt: skip
        content[packs.MANIFEST] = json.dumps(said).encode()
    path = folder / "changed.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in content.items():
            archive.writestr(name, data)
    return path


def test_a_pack_holds_what_its_rows_rest_on_and_is_the_same_bytes(packed, scenario, tmp_path):
    with zipfile.ZipFile(packed) as archive:
        names = archive.namelist()
        said = json.loads(archive.read(packs.MANIFEST))
        lock = archive.read(packs.LOCK).decode().splitlines()
    own = [name for name in names if name.startswith("method/")]
    assert own == ["method/gain.py", "method/mine.py", "method/table.txt"]
    assert sum(name.startswith("rows/") for name in names) == 6
    assert said["parameters"] == {"share": 0.4}
    assert f"numpy=={np.__version__}" in lock
    assert str(packed.parent) not in json.dumps(said)  # no path of this machine
    method = f"{packed.parent / 'mine.py'}:Mine@share=0.4"
    write_pack(method, packed.parent / "results", tmp_path / "again.zip")
    assert (tmp_path / "again.zip").read_bytes() == packed.read_bytes()


@pytest.mark.slow
def test_an_honest_pack_is_verified_elsewhere(packed, scenario, tmp_path):
    alone = tmp_path / "elsewhere" / "mine.zip"
    alone.parent.mkdir()
    shutil.copy(packed, alone)
    verdict = _verified(alone, scenario, tmp_path)
    assert [row.reason for row in Store(tmp_path / "fresh").read_all() if row.reason] == []
    assert verdict.verified, verdict.faults
    assert verdict.repeated == 3
    (one,) = verdict.comparisons
    assert one.target == "mu_front"
    assert one.fresh_runs == 4
    assert salt() == ""  # as before
    fresh = list(Store(tmp_path / "fresh").read_all())
    assert len({row.salt for row in fresh}) == 1
    assert fresh[0].salt


@pytest.mark.slow
def test_who_simulates_the_packed_drives_is_not_verified(tmp_path):
    short = gripbench.load_scenario(SCENARIO).model_copy(update={"horizon": 0.2})
    method = str(KINDS / "simulates.py")
    rows = gripbench.run(
        scenarios=[short], methods=[method], seeds=3, results=tmp_path / "results", workers=1
    )
    assert (rows["rms"] == 0.0).all()
    write_pack(method, tmp_path / "results", tmp_path / "cheat.zip")
    read = read_pack(tmp_path / "cheat.zip", tmp_path / "pack")
    from gripbench.bench.ranking import verification

    found = verification.find_scenario
    verification.find_scenario = lambda name: short
    try:
        verdict = verify(read, tmp_path / "fresh", 3, backend=Backend("loky", 1))
    finally:
        verification.find_scenario = found
    assert not verdict.verified
    assert not verdict.different  # its packed rows do come out again
    assert "on fresh seeds, 0 in the pack" in verdict.faults[0]


@pytest.mark.slow
def test_false_figures_under_right_digests_are_not_verified(packed, scenario, tmp_path):
    def better(content):
        from gripbench.bench.running.rows import Row
        from gripbench.bench.running.store import seal

        for name in [name for name in content if name.startswith("rows/")]:
            row = Row.model_validate(json.loads(content[name])["row"])
            score = row.scores["mu_front"]["rms"]
            false = score.model_copy(
                update={"value": 0.9 * score.value, "total": 0.81 * score.total}
            )
            scores = {"mu_front": {**row.scores["mu_front"], "rms": false}}
            content[name] = seal(row.model_copy(update={"scores": scores})).encode()

    verdict = _verified(_changed(packed, tmp_path, better, True), scenario, tmp_path)
    assert not verdict.verified
    assert len(verdict.different) == 3
    assert "mu_front has RMS" in verdict.different[0]


def _set(name, data):
    return lambda content: content.__setitem__(name, data)


def _row_name(content):
    return next(name for name in content if name.startswith("rows/"))


BAD = {
    "a source": (
        _set("method/gain.py", b"GAIN = 3.0\n"),
        "'method/gain.py' is not what its digest",
    ),
    "a row": (
        lambda content: content.__setitem__(_row_name(content), b"{}"),
        "is not what its digest says: it was changed",
    ),
    "the lock": (_set("lock.txt", b"numpy==0.1\n"), "'lock.txt' is not what its digest says"),
    "a new file": (_set("method/more.py", b""), "'method/more.py' is in it or in its manifest"),
    "one less": (lambda content: content.pop("method/gain.py"), "'method/gain.py' is in it or in"),
    "no manifest": (lambda content: content.pop("manifest.json"), "it has no manifest.json"),
    "no JSON": (_set("manifest.json", b"{"), "its manifest.json is not JSON"),
    "a list": (_set("manifest.json", b"[]"), "its manifest.json is no table"),
    "newer": (_set("manifest.json", b'{"format": 2}'), "written by a newer gripbench"),
    "half": (_set("manifest.json", b'{"format": 1}'), "missing key 'gripbench'"),
    "upwards": (_set("../evil.py", b""), "the entry '../evil.py' has no place in a pack"),
    "inside out": (_set("method/../../evil.py", b""), "has no place in a pack"),
    "from the root": (_set("/tmp/evil.py", b""), "has no place in a pack"),
    "a drive": (_set("method/C:evil.py", b""), "has no place in a pack"),
    "backwards": (_set("method/..\\evil.py", b""), "has no place in a pack"),
    "elsewhere": (_set("evil.py", b""), "the entry 'evil.py' has no place in a pack"),
    "same name": (_set("method/GAIN.py", b""), "two of its entries have one name"),
    "a folder": (_set("method/sub/", b""), "has no place in a pack"),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_pack_that_was_changed_is_one_line_and_nothing_is_written(packed, tmp_path, kind):
    change, words = BAD[kind]
    path = _changed(packed, tmp_path, change)
    with pytest.raises(InputError) as error:
        read_pack(path, tmp_path / "pack")
    assert words in str(error.value)
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)
    assert not (tmp_path / "pack").exists()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda row: {**row, "label": "slip_slope"}, "is not the row of its place"),
        (lambda row: {**row, "method_digest": "0"}, "is a row of another method"),
        (lambda row: {**row, "computed_outside": True}, "is a row of another method"),
        (lambda row: {**row, "status": "splendid"}, "key 'status'"),
    ],
)
def test_a_row_that_is_none_of_its_own_is_one_line(packed, tmp_path, change, words):
    from gripbench.bench.running import store

    def other(content):
        name = _row_name(content)
        body = json.dumps(change(json.loads(content[name])["row"]))
        text = f"{store._HEAD}{store._digest(body)}{store._MIDDLE}{body}}}\n"
        content[name] = text.encode()

    with pytest.raises(InputError, match=words) as error:
        read_pack(_changed(packed, tmp_path, other, True), tmp_path / "pack")
    assert "\n" not in str(error.value)


def _link(path):
    with zipfile.ZipFile(path, "w") as archive:
        info = zipfile.ZipInfo("method/link.py")
        info.external_attr = (stat.S_IFLNK | 0o777) << 16
        archive.writestr(info, "/etc/passwd")


def _bomb(path):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("method/zeros.py", bytes(packs.MOST_BYTES + 1))


def _many(path):
    with zipfile.ZipFile(path, "w") as archive:
        for k in range(packs.MOST_FILES + 1):
            archive.writestr(f"method/{k}.py", b"")


def _liar(path):
    """Says that a file of a MiB has one byte."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("method/zeros.py", bytes(1 << 20))
    data = bytearray(path.read_bytes())
    for mark, offset in ((b"PK\x03\x04", 22), (b"PK\x01\x02", 24)):
        data[data.index(mark) + offset :][:4]
        at = data.index(mark) + offset
        data[at : at + 4] = struct.pack("<I", 1)
    path.write_bytes(bytes(data))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (_link, "the entry 'method/link.py' is no plain file"),
        (_bomb, "a pack has at most 20000 files with 128 MiB"),
        (_many, "20001 files"),
        (_liar, "cannot be used as a pack"),
        (lambda path: path.write_bytes(b"not a zip"), "file is not a zip file"),
        (lambda path: path.write_bytes(b""), "file is not a zip file"),
        (lambda path: path.mkdir(), "no plain file"),
        (lambda path: None, "no such file; 'gripbench pack' writes one"),
    ],
)
def test_what_is_no_pack_is_one_line(tmp_path, make, words):
    path = tmp_path / "odd.zip"
    make(path)
    with pytest.raises(InputError, match=words) as error:
        read_pack(path, tmp_path / "pack")
    assert "\n" not in str(error.value)
    assert not (tmp_path / "pack").exists()


def test_a_truncated_pack_is_one_line_wherever_it_ends(packed, tmp_path):
    data, path = packed.read_bytes(), tmp_path / "cut.zip"
    for end in np.random.default_rng(0).integers(1, len(data), 40):
        path.write_bytes(data[: int(end)])
        with pytest.raises(InputError, match="cannot be used as a pack"):
            read_pack(path, tmp_path / "pack")


def test_a_byte_that_differs_is_found_or_changes_nothing(packed, tmp_path):
    data, path = packed.read_bytes(), tmp_path / "flipped.zip"
    with zipfile.ZipFile(packed) as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    for at in np.random.default_rng(1).integers(0, len(data), 60):
        changed = bytearray(data)
        changed[at] ^= 0x41
        path.write_bytes(bytes(changed))
        try:
            found = packs._unzipped(path)
        except InputError:
            continue
        if found != content:
            with pytest.raises(InputError):
                read_pack(path, tmp_path / f"pack{at}")


def test_what_cannot_be_packed_says_why(packed, tmp_path):
    results = packed.parent / "results"
    with pytest.raises(InputError, match="slip_slope: ships with gripbench"):
        write_pack("slip_slope", results, tmp_path / "x.zip")
    with pytest.raises(InputError, match="no stored rows of 'mine'; 'gripbench run' makes them"):
        write_pack(str(packed.parent / "mine.py"), results, tmp_path / "x.zip")
    for name in ("mine.py", "gain.py", "table.txt"):
        shutil.copy(packed.parent / name, tmp_path)
    (tmp_path / "gain.py").write_text("GAIN = 3.0\n")
    with pytest.raises(InputError, match="is not of the method as it is now; run it again"):
        write_pack(f"{tmp_path / 'mine.py'}:Mine@share=0.4", results, tmp_path / "x.zip")
    assert not (tmp_path / "x.zip").exists()


@pytest.mark.slow
def test_the_commands_say_it_in_words_and_by_exit_code(packed, scenario, tmp_path):
    app, method = application(), f"{packed.parent / 'mine.py'}:Mine@share=0.4"
    done = CliRunner().invoke(
        app, ["pack", method, "--results", str(packed.parent / "results"),
              "--to", str(tmp_path / "m.zip")],
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    assert "mine@share=0.4, 6 rows and 3 files of the method" in done.output
    call = ["verify", str(tmp_path / "m.zip"), "--seeds", "3", "--workers", "1"]
    done = CliRunner().invoke(app, [*call, "--scenario", scenario, "--format", "markdown"])
    assert done.exit_code == 0, done.output
    assert "verified: mine@share=0.4: 1 of 1 figures agree with fresh hidden drives" in done.output
    done = CliRunner().invoke(app, call)
    assert isinstance(done.exception, InputError)
    assert "rows of 'brief@1', and there is none here" in str(done.exception)


def test_an_interval_of_one_distribution_holds_its_confidence():
    """Honest packs of one to twenty runs, errors spread like those of a population."""
    draws = np.random.default_rng(0)
    for packed_runs, fresh_runs in ((1, 20), (5, 20), (20, 20)):
        missed = 0
        for _ in range(2000):
            runs = np.log(np.hypot(draws.gamma(1.5, size=packed_runs + fresh_runs), 0.1))
            difference, half = difference_of(runs[:packed_runs], runs[packed_runs:], CONFIDENCE)
            missed += abs(difference) > half
        assert missed <= 2000 * 2.5 * (1.0 - CONFIDENCE), (packed_runs, missed)


def test_a_secret_holds_for_its_block_alone(monkeypatch):
    monkeypatch.setenv("GRIPBENCH_SALT", "a secret of the job")
    with drawn_with("another secret here"):
        assert salt() == "another secret here"
    assert salt() == "a secret of the job"
