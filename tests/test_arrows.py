"""Imports run one way: commands, publishing, papers and ranking, running, scoring, catalogue,
methods, envs; no module imports itself by a detour.
"""

import ast
from pathlib import Path

import pytest

import gripbench

ROOT = Path(gripbench.__file__).parent
MODULES = {
    ".".join(("gripbench", *path.relative_to(ROOT).with_suffix("").parts)).removesuffix(
        ".__init__"
    ): path
    for path in ROOT.rglob("*.py")
}


def imported(path):
    """Return the modules of gripbench that a file imports while it is loaded."""
    found = set()
    waiting = list(ast.parse(path.read_text(encoding="utf-8")).body)
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        for name in ("body", "orelse", "finalbody", "handlers"):
            waiting.extend(getattr(node, name, []))
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        else:
            continue
        found |= {name for name in names if name in MODULES}
    return found


IMPORTS = {name: imported(path) - {name} for name, path in MODULES.items()}

FLOORS = (
    ("envs",),
    ("logs", "methods"),
    ("bench.catalogue",),
    ("bench.scoring",),
    ("bench.running", "bench.catalogue.check", "bench.catalogue.expectations"),
    ("bench.bounds",),
    ("bench.ranking",),
    (
        "bench.publishing.columns",
        "bench.publishing.tables",
        "bench.publishing.terminal",
        "bench.publishing.latex",
        "bench.publishing.figures",
        "bench.publishing.manifest",
    ),
    ("bench.papers", "bench.catalogue.listing"),
    ("bench.publishing",),
    ("bench.commands",),
)
"""From the ground up; a module stands on the floor of its longest prefix here."""

ON_PAPER = ("gripbench.envs.signals", "gripbench.envs.vehicles", "gripbench.envs.tyres")
"""What a method may know of the world: names, the car on paper, tyre formulas."""


def floor(module):
    found = [
        (len(prefix), number)
        for number, prefixes in enumerate(FLOORS)
        for prefix in prefixes
        if f"{module}.".startswith(f"gripbench.{prefix}.")
    ]
    return max(found)[1] if found else None


@pytest.mark.parametrize("module", sorted(name for name in MODULES if floor(name) is not None))
def test_a_module_imports_nothing_from_above(module):
    for name in IMPORTS[module]:
        if floor(name) is not None and name != "gripbench.bench.publishing":
            assert floor(name) <= floor(module), name


def test_logs_and_methods_do_not_know_each_other_nor_methods_the_world():
    for module, names in IMPORTS.items():
        for name in names:
            if module.startswith("gripbench.methods"):
                assert not name.startswith(("gripbench.logs", "gripbench.bench")), (module, name)
                if name.startswith("gripbench.envs."):
                    assert name.startswith(ON_PAPER), (module, name)
            if module.startswith("gripbench.logs"):
                assert not name.startswith("gripbench.methods"), (module, name)


def test_no_module_imports_itself_by_a_detour():
    left = {module: set(names) for module, names in IMPORTS.items()}
    while True:
        free = [module for module, names in left.items() if not names & left.keys()]
        if not free:
            break
        for module in free:
            del left[module]
    assert not left
