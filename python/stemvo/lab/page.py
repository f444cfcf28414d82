# SPDX-License-Identifier: MIT
"""One HTML file, readable without a network."""

import html

import pandas as pd
import plotly.graph_objects as go
import plotly.offline

_STYLE = """body{font:15px/1.5 system-ui,sans-serif;max-width:1100px;margin:2em auto;padding:0 1em;color:#1a1a1a}
table{border-collapse:collapse;font-variant-numeric:tabular-nums}th,td{padding:.2em .7em;border-bottom:1px solid #ddd;text-align:right}
th:first-child,td:first-child{text-align:left}div.wide{overflow-x:auto}pre{overflow-x:auto;background:#f6f6f6;padding:1em}"""


def write(file, title, sections):
    """sections: heading, and what stands under it: texts, tables of texts (DataFrame) and plotly's figures."""
    body = "".join(f"<h2>{html.escape(heading)}</h2>\n" + "".join(_part(part, f"figure-{i}-{k}") for k, part in enumerate(parts))
                   for i, (heading, *parts) in enumerate(sections))
    has_figure = any(isinstance(part, go.Figure) for _, *parts in sections for part in parts)
    script = f"<script>{plotly.offline.get_plotlyjs()}</script>" if has_figure else ""
    file.write_text(f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}</title><style>{_STYLE}</style>'
                    f"{script}</head><body><h1>{html.escape(title)}</h1>\n{body}</body></html>\n")


def _part(part, name):
    if isinstance(part, go.Figure):
        return part.to_html(full_html=False, include_plotlyjs=False, div_id=name)
    if isinstance(part, pd.DataFrame):
        return f'<div class="wide">{part.to_html(index=False, border=0)}</div>\n'
    return f"<pre>{html.escape(part)}</pre>\n" if "\n" in part else f"<p>{html.escape(part)}</p>\n"
