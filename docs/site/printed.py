"""What commands print, kept true in the pages: in, a page's Markdown; out, the same, run again.

A page marks a block as the output of a command::

    <!-- printed by: gripbench list suites -->
    ```text
    ...
    ```

A command is `gripbench` or `python` with its arguments; `{folder}` is a folder that goes away, and
`| tail N` after it keeps the last N lines.

`python docs/site/printed.py` writes what the commands print now into the pages; the site runs them
when it is built, and a test holds the pages against them. An output is kept in `.cache/printed`
until a source of gripbench or a published result changes.
"""

from __future__ import annotations

import hashlib
import os
import re
import shlex
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
_GRIPBENCH = "from gripbench.bench.command_line import main; main()"
CACHE = ROOT / ".cache" / "printed"
BLOCK = re.compile(
    r"(?P<head><!-- printed by: (?P<command>(?:gripbench|python) [^\n]+?) -->\n+```\w*\n)"
    r"(?P<text>.*?)(?P<tail>```)",
    re.DOTALL,
)


def refreshed(markdown: str) -> str:
    """Return a page whose marked blocks hold what their commands print now."""
    return BLOCK.sub(lambda m: m["head"] + printed(m["command"]) + m["tail"], markdown)


def printed(command: str) -> str:
    """Return what a command prints on 100 columns, run in the repository's root.

    Raises
    ------
    RuntimeError
        If it fails; a page must not show that.
    """
    kept = CACHE / f"{hashlib.sha256(f'{command} {_state()}'.encode()).hexdigest()[:24]}.txt"
    if kept.is_file():
        return kept.read_text(encoding="utf-8")
    call, _, last = command.partition(" | tail ")
    with tempfile.TemporaryDirectory() as folder:
        program, *arguments = shlex.split(call.replace("{folder}", folder))
        start = ["-c", _GRIPBENCH] if program == "gripbench" else []
        done = subprocess.run(
            [sys.executable, *start, *arguments],
            cwd=ROOT,
            env={**os.environ, "COLUMNS": "100", "NO_COLOR": "1", "PYTHONPATH": str(ROOT)},
            capture_output=True,
            text=True,
            timeout=600,
        )
    if done.returncode:
        raise RuntimeError(f"{command}: exit code {done.returncode}: {done.stderr.strip()}")
    lines = [line.rstrip() for line in done.stdout.strip("\n").splitlines()]
    while lines and not lines[0]:
        del lines[0]
    text = "".join(f"{line}\n" for line in lines[-int(last or 0) :])
    CACHE.mkdir(parents=True, exist_ok=True)
    kept.write_text(text, encoding="utf-8")
    return text


@cache
def _state() -> str:
    """Return a digest of all that an output may depend on."""
    state = hashlib.sha256()
    sources = [path for kind in ("py", "toml") for path in (ROOT / "gripbench").rglob(f"*.{kind}")]
    results = [path for path in (ROOT / "results").rglob("*.json") if "rows" not in path.parts]
    for path in sorted(sources + results):
        state.update(str(path.relative_to(ROOT)).encode() + path.read_bytes())
    return state.hexdigest()


def pages() -> list[Path]:
    """Return the pages that hold marked blocks."""
    every = [*sorted((ROOT / "docs").glob("*.md")), ROOT / "README.md"]
    return [page for page in every if BLOCK.search(page.read_text(encoding="utf-8"))]


if __name__ == "__main__":
    for page in pages():
        page.write_text(refreshed(page.read_text(encoding="utf-8")), encoding="utf-8")
