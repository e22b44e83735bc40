"""An HTML template in, ready to fill: texts become their letters, tables become HTML."""

from __future__ import annotations

from pathlib import Path

import jinja2
from markupsafe import Markup

from gripbench.bench.publishing import tables
from gripbench.bench.publishing.columns import Table


def template(folder: Path, name: str) -> jinja2.Template:
    """Return a template of a folder; what it does not know is an error, `table` is a filter."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(folder),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["table"] = _table
    return environment.get_template(name)


def _table(table: Table) -> Markup:
    return Markup(tables.html(table))
