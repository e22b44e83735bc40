"""What the kernel refuses a confined process: results, other files, memory that outlives it."""

import subprocess
import sys

import pytest

from gripbench.bench.running.isolation.landlock import _beside, landlock_version

needs_landlock = pytest.mark.skipif(landlock_version() < 3, reason="the kernel has no Landlock")

PROGRAM = """
import ctypes, os, sys
from gripbench.bench.running.isolation.landlock import drop_powers, enter_domain
from gripbench.bench.running.isolation.landlock import refuse_kept_memory

folder = sys.argv[1]
drop_powers()
enter_domain((folder, ("results",)))
refuse_kept_memory()
enter_domain(writable=[folder + "/scratch"], scoped=False)

def tries(name, act):
    try:
        act()
    except OSError as error:
        print(name, error.errno)
    else:
        print(name, "done")

def write(path):
    with open(path, "w") as file:
        file.write("x")

tries("read beside", lambda: open(folder + "/beside.txt").read())
tries("read results", lambda: open(folder + "/results/rows/0.json").read())
tries("write scratch", lambda: write(folder + "/scratch/own.txt"))
tries("read scratch", lambda: open(folder + "/scratch/own.txt").read())
tries("write beside", lambda: write(folder + "/beside.txt"))
tries("make beside", lambda: write(folder + "/new.txt"))
tries("make folder", lambda: os.mkdir(folder + "/new"))
tries("remove beside", lambda: os.remove(folder + "/beside.txt"))
tries("rename", lambda: os.rename(folder + "/beside.txt", folder + "/moved.txt"))
tries("attribute", lambda: os.setxattr(folder + "/beside.txt", "user.x", b"1"))
tries("shared", lambda: write("/dev/shm/gripbench_test"))
tries("null", lambda: write("/dev/null"))
print("system v", ctypes.CDLL(None).shmget(0x67726970, 4096, 0o1600) >= 0)
print("queue", ctypes.CDLL(None).msgget(0x67726970, 0o1600) >= 0)
tries("environment of the parent", lambda: open(f"/proc/{os.getppid()}/environ", "rb").read())
"""

REFUSED = 13, 1
"""EACCES, EPERM."""


@needs_landlock
def test_a_confined_process_reads_no_results_and_leaves_nothing_behind(tmp_path):
    (tmp_path / "results" / "rows").mkdir(parents=True)
    (tmp_path / "scratch").mkdir()
    (tmp_path / "results" / "rows" / "0.json").write_text("{}")
    (tmp_path / "beside.txt").write_text("x")
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(tmp_path)], capture_output=True, text=True, check=True
    )
    found = dict(line.rsplit(" ", 1) for line in done.stdout.splitlines())
    allowed = {name for name, outcome in found.items() if outcome == "done"}
    assert allowed == {"read beside", "write scratch", "read scratch", "null"}
    refused = {name: outcome for name, outcome in found.items() if name not in allowed}
    assert refused.pop("system v") == "False"
    assert refused.pop("queue") == "False"
    assert {int(outcome) for outcome in refused.values()} <= set(REFUSED)
    assert (tmp_path / "beside.txt").read_text() == "x"
    assert not (tmp_path / "new.txt").exists()


def test_what_lies_beside_a_closed_folder_is_found_at_every_level(tmp_path):
    for name in ("a/rows", "a/b", "c"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "a" / "file").touch()
    found = _beside(str(tmp_path / "a"), ("rows", "checks"))
    assert {str(tmp_path / "c"), str(tmp_path / "a/b"), str(tmp_path / "a/file")} <= set(found)
    closed = {str(tmp_path / "a/rows"), str(tmp_path / "a"), str(tmp_path)}
    assert not closed & set(found)
    absent = _beside(str(tmp_path / "not" / "there"), ("rows",))
    assert {str(tmp_path / "a"), str(tmp_path / "c")} <= set(absent)
