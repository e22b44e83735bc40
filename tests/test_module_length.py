"""A module is one subject that fits a few screens."""

from pathlib import Path

import gripbench

MOST = 400
ROOT = Path(gripbench.__file__).parent


def test_no_module_is_longer_than_400_lines():
    lines = {
        path.relative_to(ROOT).as_posix(): len(path.read_text(encoding="utf-8").splitlines())
        for path in ROOT.rglob("*.py")
    }
    assert len(lines) > 200
    assert not {name for name, count in lines.items() if count > MOST}
