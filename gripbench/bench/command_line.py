"""The command `gripbench`: every user error is one line and exit code 2, never a traceback."""

from __future__ import annotations

import gc
import importlib
import os
import pkgutil
import signal
import sys
from typing import Annotated, NoReturn

import typer

from gripbench import __version__
from gripbench.bench import commands
from gripbench.compilation import declare_only
from gripbench.errors import GripbenchError, InterruptionError


def application() -> typer.Typer:
    """Return the application with the commands of every module in `gripbench.bench.commands`."""
    app = typer.Typer(
        name="gripbench",
        help="A benchmark of estimators of tyre-road friction and vehicle sideslip.",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
    )
    app.callback(invoke_without_command=True)(_options)
    names = [module.name for module in pkgutil.iter_modules(commands.__path__)]
    order = commands.ORDER
    for name in sorted(names, key=lambda name: order.index(name) if name in order else len(order)):
        importlib.import_module(f"{commands.__name__}.{name}").register(app)
    return app


def _options(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Take what stands before a command."""
    if version:
        print(__version__)
        raise typer.Exit


def main() -> None:
    """Run the command line; end with 2 on wrong usage or input, 130 when interrupted."""
    gc.set_threshold(200_000)  # thousands of stored rows are read: looking for cycles costs as much
    if _only_tells(sys.argv[1:]):
        declare_only()
    try:
        code = application()(standalone_mode=False)
        if code == _INTERRUPTED:  # some versions of typer return this instead of raising
            raise KeyboardInterrupt
        sys.stdout.flush()
    except InterruptionError as error:
        _stop(str(error), _INTERRUPTED)
    except GripbenchError as error:
        _stop(str(error), 2)
    except (KeyboardInterrupt, typer.Abort):
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # one is enough: what follows is short
        _stop("interrupted; what had finished is kept: run the same command again", _INTERRUPTED)
    except BrokenPipeError:
        # whoever read the output has gone: no words can reach anybody
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        sys.exit(1)
    except Exception as error:
        # wrong usage; typer's own class for it has moved between its versions
        usage = getattr(error, "format_message", None)
        if usage is None:
            raise
        message = " ".join(usage().split()).replace("Value error, ", "")  # a library's own words
        if not message or "no_args" in type(error).__name__.lower():
            error.show()  # type: ignore[attr-defined]
            sys.exit(2)
        _stop(message[:1].lower() + message[1:], 2)
    sys.exit(code or 0)


def _only_tells(arguments: list[str]) -> bool:
    """Return whether a command line asks what there is and runs no compiled function."""
    command, *rest = arguments or [""]
    runs = ("recording:", "gripbench/")  # a log is read, an environment is made
    return command == "list" or (
        command == "show" and not any(name.startswith(runs) for name in rest)
    )


_INTERRUPTED = 130
"""Exit code of an interrupted command, as shells give it."""


def _stop(message: str, code: int) -> NoReturn:
    print(f"gripbench: {message}", file=sys.stderr)
    sys.exit(code)


if __name__ == "__main__":
    main()
