"""What the workflow and the pages on ranking call does exist."""

import re
import shlex
from pathlib import Path

import pytest
import typer.main

from gripbench.bench.command_line import application
from gripbench.bench.ranking.ranking import columns

ROOT = Path(__file__).parents[2]
FILES = (
    ".github/workflows/benchmark.yml", "docs/ranking.md", "docs/leaderboard.md",
    "docs/consistency.md",
)  # fmt: skip


def calls(file):
    text = (ROOT / file).read_text(encoding="utf-8").replace("\\\n", " ")
    return re.findall(r"^\s*(?:run: )?gripbench ([^|\n]+)", text, flags=re.M)


@pytest.mark.parametrize("file", FILES)
def test_commands_and_their_options_exist(file):
    assert calls(file)
    for call in calls(file):
        words = shlex.split(call)
        command = typer.main.get_command(application())
        while hasattr(command, "commands"):
            assert words[0] in command.commands, call
            command = command.commands[words.pop(0)]
        known = {name for parameter in command.params for name in parameter.opts}
        used = {word.partition("=")[0] for word in words if word.startswith("--")}
        assert used <= known, call


def test_every_column_of_a_ranking_is_described():
    text = (ROOT / "docs/ranking.md").read_text(encoding="utf-8")
    described = {
        name
        for line in text[text.index("## Columns") :].splitlines()
        if line.startswith("| `")
        for name in re.findall(r"`(\w+)`", line.split(" | ")[0])
    }
    assert described == set(columns())
