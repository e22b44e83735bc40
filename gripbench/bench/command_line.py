"""The command `gripbench`: every user error is one line and exit code 2, never a traceback."""

from __future__ import annotations

import importlib
import pkgutil
import sys

import typer

from gripbench.bench import commands
from gripbench.errors import GripbenchError


def application() -> typer.Typer:
    """Return the application with the commands of every module in `gripbench.bench.commands`."""
    app = typer.Typer(
        name="gripbench",
        help="A benchmark of estimators of tyre-road friction and vehicle sideslip.",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
    )
    for module in pkgutil.iter_modules(commands.__path__):
        importlib.import_module(f"{commands.__name__}.{module.name}").register(app)
    return app


def main() -> None:
    """Run the command line."""
    try:
        application()()
    except GripbenchError as error:
        print(f"gripbench: {error}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
