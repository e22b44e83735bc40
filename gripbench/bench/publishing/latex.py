"""Plain text as LaTeX that compiles with the article class and pdfTeX."""

from __future__ import annotations

import re
from collections.abc import Sequence

_LETTERS = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_",
    "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "<": r"$<$", ">": r"$>$", "|": r"$|$", '"': "''", "\n": " ",
    "–": "--", "—": "---", "−": "$-$", "±": r"$\pm$", "×": r"$\times$", "·": r"$\cdot$",
    "≤": r"$\le$", "≥": r"$\ge$", "≠": r"$\ne$", "≈": r"$\approx$", "²": "$^2$", "°": r"$^\circ$",
    "∞": r"$\infty$", "→": r"$\to$", "√": r"$\surd$", "µ": r"$\mu$", "α": r"$\alpha$",
    "β": r"$\beta$", "γ": r"$\gamma$", "δ": r"$\delta$", "κ": r"$\kappa$", "λ": r"$\lambda$",
    "μ": r"$\mu$", "σ": r"$\sigma$", "τ": r"$\tau$", "φ": r"$\phi$", "ψ": r"$\psi$",
    "ω": r"$\omega$", "θ": r"$\theta$", "Δ": r"$\Delta$", "…": r"\ldots{}",
}  # fmt: skip


def latex_line(cells: Sequence[str]) -> str:
    """Return a line of a tabular from its cells, which are LaTeX already."""
    # a line that starts with a bracket or star would be read as an option of the end of the last
    protection = "{}" if cells[0].startswith(("[", "*")) else ""
    return protection + " & ".join(cells) + r" \\"


def latex_text(text: str) -> str:
    """Return plain text as LaTeX; powers such as m/s^2 become superscripts."""
    pieces = re.split(r"\^(-?\d+)", text)  # powers in units, such as m/s^2
    return "".join(
        f"$^{{{piece}}}$"
        if index % 2
        else "".join(_LETTERS.get(letter, letter) for letter in piece)
        for index, piece in enumerate(pieces)
    )


def latex_number(text: str) -> str:
    """Return a formatted number as LaTeX, its exponent as a power of ten."""
    match = re.fullmatch(r"([+-]?[\d.,]+)e([+-]\d+)", text)
    if match:
        return rf"${match[1]}\times10^{{{int(match[2])}}}$"
    return f"${text}$" if re.fullmatch(r"[+-][\d.]+", text) else latex_text(text)
