# SPDX-License-Identifier: MIT
"""One HTML file, readable without a network."""

import html

import pandas as pd
import plotly.graph_objects as go
import plotly.offline

# The texts of figures take the colour of the page's while it is open; the row above a figure is its buttons'.
_STYLE = """:root{color-scheme:light dark}body{font:15px/1.5 system-ui,sans-serif;max-width:1100px;margin:2em auto;padding:0 1em}
table{border-collapse:collapse;font-variant-numeric:tabular-nums}th,td{padding:.2em .7em;border-bottom:1px solid #8886;text-align:right}
th:first-child,td:first-child{text-align:left}div.wide{overflow-x:auto}pre{overflow-x:auto;background:#8882;padding:1em}
.infolayer text,.cartesianlayer text{fill:canvastext!important}.js-plotly-plot{margin-top:32px}.modebar-container{top:-32px!important}"""


def write(file, title, sections):
    """sections: heading, and what stands under it: texts, tables of texts (DataFrame) and plotly's figures."""
    body = "".join(f"<h2>{html.escape(heading)}</h2>\n" + "".join(_part(part, f"figure-{i}-{k}") for k, part in enumerate(parts))
                   for i, (heading, *parts) in enumerate(sections))
    script = f"<script>{plotly.offline.get_plotlyjs()}</script>" if "plotly-graph-div" in body else ""
    file.write_text('<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'
                    f"<title>{html.escape(title)}</title><style>{_STYLE}</style>{script}</head><body><h1>{html.escape(title)}</h1>\n{body}</body></html>\n")


def _part(part, name):
    if isinstance(part, go.Figure):
        return part.to_html(full_html=False, include_plotlyjs=False, div_id=name)
    if isinstance(part, pd.DataFrame):
        return f'<div class="wide">{part.to_html(index=False, border=0)}</div>\n'
    return f"<pre>{html.escape(part)}</pre>\n" if "\n" in part else f"<p>{html.escape(part)}</p>\n"
