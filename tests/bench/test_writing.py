"""Every file is written whole, through links, and over nothing but a plain file."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from gripbench.errors import InputError
from gripbench.writing import being_written, check_writable, write_atomically

PACKAGE = Path(__file__).parents[2] / "gripbench"


def test_a_link_is_written_through_and_stays(tmp_path):
    (tmp_path / "kept").mkdir()
    real, link = tmp_path / "kept" / "scores.csv", tmp_path / "scores.csv"
    real.write_text("old")
    real.chmod(0o640)
    link.symlink_to("kept/scores.csv")
    write_atomically(link, "new")
    assert link.is_symlink()
    assert real.read_text() == "new"
    assert real.stat().st_mode & 0o777 == 0o640
    dangling = tmp_path / "dangling"
    dangling.symlink_to(tmp_path / "kept" / "fresh.csv")
    write_atomically(dangling, "fresh")
    assert (tmp_path / "kept" / "fresh.csv").read_text() == "fresh"
    assert sorted(path.name for path in (tmp_path / "kept").iterdir()) == [
        "fresh.csv",
        "scores.csv",
    ]


@pytest.mark.parametrize("kind", ["fifo", "device", "folder", "link to a device"])
def test_what_is_no_plain_file_is_refused_and_stays(tmp_path, kind):
    path = tmp_path / "target"
    if kind == "fifo":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    elif kind == "link to a device":
        path.symlink_to("/dev/null")
    else:
        path = Path("/dev/null")
    before = path.stat()
    for act in (check_writable, lambda place: write_atomically(place, "x")):
        with pytest.raises(InputError, match=r"cannot be written: it is (a folder|no plain file)"):
            act(path)
    assert path.stat().st_ino == before.st_ino


def test_a_file_in_place_of_a_folder_is_noticed_before_the_work(tmp_path):
    (tmp_path / "file").write_text("mine")
    for name in ("file/scores.csv", "file/deeper/scores.csv"):
        with pytest.raises(InputError, match="a file"):
            check_writable(tmp_path / name)
        with pytest.raises(InputError, match="one of its folders is a file"):
            write_atomically(tmp_path / name, "x")
    assert (tmp_path / "file").read_text() == "mine"
    check_writable(tmp_path / "new" / "deeper" / "scores.csv")
    assert not (tmp_path / "new").exists()


def test_an_error_while_writing_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "picture.png"
    path.write_text("old")
    with pytest.raises(ZeroDivisionError), being_written(path) as temporary:  # noqa: PT012
        assert temporary.suffix == ".png"
        temporary.write_text("half")
        raise ZeroDivisionError
    assert [item.read_text() for item in tmp_path.iterdir()] == ["old"]


def test_a_dash_is_standard_output():
    program = "from pathlib import Path; from gripbench.writing import write_atomically as w; "
    done = subprocess.run(
        [sys.executable, "-c", program + "w(Path('-'), 'a,b\\n')"], capture_output=True, check=True
    )
    assert done.stdout == b"a,b\n"


def test_nothing_of_the_package_writes_a_file_in_another_way():
    # a recording fills a new folder that is renamed as a whole, a pack is unpacked aside
    own = {"writing.py", "storing.py", "packs.py"}
    found = [
        path.name
        for path in PACKAGE.rglob("*.py")
        if path.name not in own
        for line in path.read_text(encoding="utf-8").splitlines()
        if ".write_text(" in line or ".write_bytes(" in line
    ]
    assert found == []
