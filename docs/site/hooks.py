"""Hooks of the site: a generated page, links into the repository, formulas."""

from __future__ import annotations

import posixpath
import re
import sys
from html import unescape
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.structure.files import File, Files

from gripbench.bench.publishing.equation_pages import equations_page
from gripbench.bench.publishing.method_pages import catalogue_page

ROOT = Path(__file__).parents[2]
sys.path.append(str(Path(__file__).parent))
from printed import refreshed  # noqa: E402 - a module of this folder, which is no package

_LINK = re.compile(r"(?<!!)\[([^\]]*)\]\((\.\./[^)\s]+)\)")
_FORMULA = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that are made from the code: the catalogue of methods, and the equations."""
    text = catalogue_page(ROOT / "results")
    files.append(File.generated(config, "methods.md", content=text))
    files.append(File.generated(config, "equations.md", content=equations_page()))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Show what marked commands print now, and paths of the repository where a page links to them.

    A link to a file that does not exist stays, so that the strict build names it.
    """

    def shown(link: re.Match[str]) -> str:
        here = posixpath.dirname(f"docs/{page.file.src_uri}")
        path = posixpath.normpath(posixpath.join(here, link[2].partition("#")[0]))
        if path.startswith("docs/") or not (ROOT / path).exists():
            return link[0]
        return f"{link[1]} (`{path}`)" if link[1].strip("`") != path else f"`{path}`"

    return _LINK.sub(shown, refreshed(markdown))


def on_page_content(html: str, **_: Any) -> str:
    """Turn formulas into MathML, which browsers show without a script."""
    return _FORMULA.sub(
        lambda found: convert(
            unescape(found[3]).strip(), display="inline" if found[2] == "(" else "block"
        ),
        html,
    )
