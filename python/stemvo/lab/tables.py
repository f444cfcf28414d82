# SPDX-License-Identifier: MIT
"""A table as text, Markdown, LaTeX and CSV."""

import pandas as pd

_LATEX = {"\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{", "}": r"\}",
          "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "<": r"\textless{}", ">": r"\textgreater{}", "|": r"\textbar{}"}
LEFT = ("frames", "method", "scale from", "alignment", "note", "ran on")  # columns of words
PAGE_ROWS, MORE = 45, " (continued)"
WIDEST = 48  # letters in a row of a table that fits into one of two columns of text
_FIT = r"\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{%"  # made smaller, never larger


def cell(value, decimals=2):
    """For people: a number with so many decimals; nothing known: `-`."""
    if isinstance(value, str):
        return " ".join(value.split())
    if value is None or pd.isna(value):
        return "-"
    return f"{value:.{decimals}f}" if isinstance(value, float) else str(value)


def formatted(frame, decimals):
    """All cells as text. decimals: of a column's numbers; 2 where it names none."""
    return pd.DataFrame({name: [cell(value, decimals.get(name, 2)) for value in frame[name]] for name in frame.columns}, dtype=object)


def markdown(frame):
    rows = [list(map(str, frame.columns)), ["---"] * len(frame.columns), *frame.values.tolist()]
    return "".join("| " + " | ".join(text.replace("|", "\\|") for text in row) + " |\n" for row in rows)


def latex(frame, caption, notes=()):
    """A table by the packages booktabs and graphicx, of as many parts as fit pages; a wide one goes over both columns. Numbers are right."""
    if len(frame) > PAGE_ROWS:
        return latex(frame[:PAGE_ROWS], caption, notes) + latex(frame[PAGE_ROWS:], f"{caption.removesuffix(MORE)}{MORE}")
    rows = [" & ".join(map(_escaped, row)) + r" \\" for row in [list(frame.columns), *frame.values.tolist()]]
    kinds = "".join("l" if i == 0 or name in LEFT else "r" for i, name in enumerate(frame.columns))
    environment = "table*" if max(map(len, text(frame).splitlines())) > WIDEST else "table"
    lines = [rf"\begin{{{environment}}}", r"\centering", rf"\caption{{{_escaped(caption)}}}", _FIT,
             rf"\begin{{tabular}}{{{kinds}}}", r"\toprule", rows[0], r"\midrule", *rows[1:], r"\bottomrule", r"\end{tabular}}",
             *(rf"\par\footnotesize {_escaped(note)}" for note in notes), rf"\end{{{environment}}}"]
    return "\n".join(lines) + "\n"


def _escaped(text):
    return "".join(_LATEX.get(letter, letter) for letter in str(text))


def text(frame):
    """Columns side by side; numbers are right."""
    rows = [list(map(str, frame.columns)), *frame.values.tolist()]
    widths = [max(map(len, column)) for column in zip(*rows)]
    return "".join("  ".join(cell.ljust(width) if i == 0 or frame.columns[i] in LEFT else cell.rjust(width)
                             for i, (cell, width) in enumerate(zip(row, widths))).rstrip() + "\n" for row in rows)


def write(frame, stem, caption, notes=(), decimals=None):
    """stem.txt, .md, .tex for people; stem.csv with all digits. Returns the text."""
    shown = formatted(frame, decimals or {})
    said = "".join(f"{note}\n" for note in notes)
    files = {".txt": f"{caption}\n\n{text(shown)}{said and chr(10) + said}", ".tex": latex(shown, caption, notes),
             ".md": f"# {caption}\n\n{markdown(shown)}" + "".join(f"\n{note}\n" for note in notes)}
    for suffix, content in files.items():
        stem.with_name(stem.name + suffix).write_text(content)
    frame.to_csv(stem.with_name(stem.name + ".csv"), index=False)
    return files[".txt"]
