"""What the pages of the documentation show runs as it stands there."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from gripbench.bench.catalogue.registry import built_in_methods
from gripbench.bench.publishing import leaderboard, method_pages

ROOT = Path(__file__).parents[2]
QUICK = ("docs/add-a-vehicle.md", "docs/contract.md", "docs/extend.md", "docs/trained.md")
SLOW = (
    "README.md",
    "docs/index.md",
    "docs/add-a-method.md",
    "docs/add-a-scenario.md",
    "docs/figures.md",
    "docs/ranking.md",
    "docs/api.md",
    "docs/environments.md",
)
PAGES = (*QUICK, *(pytest.param(page, marks=pytest.mark.slow) for page in SLOW))
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
FILE = re.compile(r"# (\S+\.(?:py|toml))\n")


def blocks(page):
    return BLOCK.findall((ROOT / page).read_text(encoding="utf-8"))


def script(page):
    """Return a program that does what the blocks of a page do, one after the other."""
    lines = ["from typer.testing import CliRunner", "from pathlib import Path"]
    lines += ["from gripbench.bench.command_line import application", "app = application()"]
    for language, text in blocks(page):
        named = FILE.match(text)
        if named:
            lines.append(f"Path({named[1]!r}).write_text({text!r}, encoding='utf-8')")
        elif language == "python":
            lines.append(text)
        elif language == "console":
            for call in text.splitlines():
                words = shlex.split(call)[1:]
                lines.append(f"done = CliRunner().invoke(app, {words!r}, catch_exceptions=False)")
                lines.append(f"assert done.exit_code == 0, ({call!r}, done.output)")
    return "\n".join(lines)


@pytest.mark.parametrize("page", PAGES)
def test_the_blocks_of_a_page_run(page, tmp_path):
    assert blocks(page)
    program = tmp_path / "page.py"
    program.write_text(script(page), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, program.name], cwd=tmp_path, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr[-3000:]


def test_every_method_is_in_the_catalogue_with_its_reference(tmp_path):
    text = method_pages.catalogue_page(tmp_path).replace("\\", "")
    for name, method in built_in_methods().items():
        assert f"`{name}`. {method.reference}".removesuffix(".") in text
        assert f"## {method.title}" in text
        for parameter in method.parameters:
            assert f"| {parameter.unit} | {parameter.description} |" in text
    assert "no results are published" in text


def runs(label, rms, scenario="step", failed=None):
    return leaderboard.Runs(
        scenario=scenario, target="mu", label=label, seeds=(0,), sums_of_squares=(rms**2,),
        counts=(1,), failed=failed or {},
    )  # fmt: skip


def published(*found):
    return leaderboard.Leaderboard(
        gripbench="0", confidence=0.95, boards=(), runtimes={}, runs=found
    )


def test_a_method_fails_where_it_is_three_times_worse_than_the_best():
    board = published(runs("best", 0.1), runs("poor", 0.31), runs("fair", 0.29))
    assert method_pages.failures_of("fair", board) == []
    assert method_pages.failures_of("best", board) == []
    assert method_pages.failures_of("poor", board) == [
        "`mu` in step: RMS 0.310, 3.1 times the best"
    ]


def test_the_best_is_a_method_that_a_vehicle_could_have():
    board = published(runs("ideal", 0.01), runs("best", 0.1), runs("poor", 0.5))
    boards = ({"methods": [{"label": "ideal", "idealised": "wheel_acceleration_front"}]},)
    board = board.model_copy(update={"boards": boards})
    assert method_pages.failures_of("best", board) == []
    assert len(method_pages.failures_of("poor", board)) == 1


def test_the_worst_scenarios_come_first():
    scenarios = [f"s{number}" for number in range(10)]
    found = [runs("best", 0.1, name) for name in scenarios]
    found += [runs("poor", 0.1 * (4 + number), name) for number, name in enumerate(scenarios)]
    lines = method_pages.failures_of("poor", published(*found))
    assert len(lines) == method_pages.SHOWN
    assert lines[0] == "`mu` in s9: RMS 1.30, 13 times the best"


def test_a_method_fails_where_runs_failed_but_not_where_they_were_skipped():
    broken = runs("broken", 0.1, failed={1: "failed: ValueError"})
    skipped = runs("skipped", 0.1, failed={1: "skipped: no sensor"})
    board = published(broken, skipped)
    assert method_pages.failures_of("broken", board) == [
        "`mu` in step: 1 of 2 runs failed (failed: ValueError)"
    ]
    assert method_pages.failures_of("skipped", board) == []


NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
RATIOS = {("yoon2015", "4.97"), ("yoon2015", "0.58")}
"""Quotients of two published figures."""


@pytest.mark.parametrize("paper", ["anderson2004", "dakhlallah2008", "li2014", "yoon2015"])
def test_figures_of_ours_in_a_paper_s_tables_are_the_published_ones(paper):
    published = [
        float(number)
        for file in (ROOT / "results" / paper).glob("*.csv")
        for number in NUMBER.findall(file.read_text(encoding="utf-8"))
    ]
    heading: list[str] = []
    for line in (ROOT / "docs" / f"{paper}.md").read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")] if line[:1] == "|" else []
        heading = heading if heading and cells else cells
        for title, cell in zip(heading, cells, strict=False):
            for text in NUMBER.findall(cell) if title.lower() in ("ours", "gripbench") else ():
                half = 0.51 * 10.0 ** -len(text.partition(".")[2])
                near = any(abs(abs(one) - abs(float(text))) <= half for one in published)
                assert near or (paper, text) in RATIOS, line


def test_the_closing_lines_of_the_readme_are_those_of_the_published_reproduction():
    closing = re.search(
        r"```\n(\d+ of \d+ cells.*?)```", (ROOT / "README.md").read_text("utf-8"), re.S
    )
    assert closing is not None
    published = (ROOT / "results" / "li2014" / "README.md").read_text(encoding="utf-8")
    for line in closing[1].splitlines():
        assert f"- {line}\n" in published


@pytest.mark.slow
def test_marked_blocks_hold_what_their_commands_print():
    sys.path.append(str(ROOT / "docs" / "site"))
    import printed

    for page in printed.pages():
        text = page.read_text(encoding="utf-8")
        assert printed.refreshed(text) == text, f"{page.name}: python docs/site/printed.py"
