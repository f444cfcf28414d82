# SPDX-License-Identifier: MIT
"""Figures in a paper's widths and fonts, and the same for a page."""

import matplotlib
import numpy as np
import plotly.graph_objects as go

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

WIDTHS_IN = {"column": 3.5, "text": 7.16}  # of two-column journals
COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")  # told apart by the colour-blind (Okabe and Ito)
DASHES = (("-", "solid"), ("--", "dash"), (":", "dot"), ("-.", "dashdot"))  # matplotlib's, plotly's
TRUTH, TRUTH_COLOR = "ground truth", "#b0b0b0"
AXIS = {"gridcolor": "rgba(128,128,128,0.25)", "zeroline": False, "automargin": True}  # seen on a light page and on a dark one
PAGE = {"template": {"layout": {"xaxis": AXIS, "yaxis": AXIS}}, "showlegend": True, "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom"},
        "margin": {"l": 60, "r": 20, "t": 20, "b": 50}, "hoverlabel": {"namelength": -1}, "modebar": {"color": "#888888", "activecolor": "#888888"},
        **dict.fromkeys(("paper_bgcolor", "plot_bgcolor", "modebar_bgcolor"), "rgba(0,0,0,0)")}
plt.rcParams.update({"font.family": "serif", "font.serif": ["STIXGeneral"], "mathtext.fontset": "stix", "font.size": 8, "axes.titlesize": 8,
                     "legend.fontsize": 7, "lines.linewidth": 1.0, "axes.linewidth": 0.6, "pdf.fonttype": 42, "svg.hashsalt": "stemvo",
                     "axes.spines.top": False, "axes.spines.right": False, "legend.frameon": False})


def looks(names):
    """By name, in their order: colour, and dashes of both libraries, which tell lines apart where there are more than colours. The ground
    truth is gray and takes none."""
    others = [name for name in names if name != TRUTH]
    return {TRUTH: (TRUTH_COLOR, "-", "solid"),
            **{name: (COLORS[i % len(COLORS)], *DASHES[i // len(COLORS) % len(DASHES)]) for i, name in enumerate(others)}}


def sheet(panels, width="text", columns=3, height_in=None):
    """A figure of so many panels, and these."""
    columns = min(columns, panels)
    rows = -(-panels // columns)
    size = (WIDTHS_IN[width], height_in or WIDTHS_IN[width] / columns * rows)
    figure, axes = plt.subplots(rows, columns, figsize=size, squeeze=False, layout="constrained")
    for axis in axes.flat[panels:]:
        axis.axis("off")
    return figure, list(axes.flat[:panels])


def legend(figure, axes):
    """Below all panels, each name once."""
    handles = {label: line for axis in axes for line, label in zip(*axis.get_legend_handles_labels())}
    if handles:
        figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=2)


def save(figure, stem):
    """stem.svg and stem.pdf, the same bytes each time."""
    figure.savefig(stem.with_name(stem.name + ".svg"), metadata={"Date": None})
    figure.savefig(stem.with_name(stem.name + ".pdf"), metadata={"CreationDate": None, "ModDate": None})
    plt.close(figure)


def plane_of(positions):
    """Indices of the axes of a map from above: x and z of a camera; x and y where the path goes farther along y."""
    _, along_y, along_z = np.ptp(positions, axis=0)
    return [0, 1 if along_y > along_z else 2]


def draw_paths(axis, paths, title="", axes_of=None):
    """paths: name -> Nx3 positions, m. A map from above, one metre as long both ways. Each line is thinner than those under it and
    ends in a dot, so that none is hidden, and one that never moves is seen."""
    first, second = axes_of or plane_of(np.concatenate(list(paths.values())))
    styles = looks(paths)
    for index, (name, positions) in enumerate(paths.items()):
        color, dash, _ = styles[name]
        width = 2.2 - 1.5 * index / max(len(paths) - 1, 1)
        axis.plot(positions[:, first], positions[:, second], dash, color=color, label=name, linewidth=width)
        axis.plot(*positions[-1, [first, second]], "o", color=color, markersize=1.5 + 1.5 * width, markeredgewidth=0)
    axis.set(title=title, xlabel=f"{'xyz'[first]}, m", ylabel=f"{'xyz'[second]}, m")
    axis.set_aspect("equal", adjustable="datalim")


def draw_lines(axis, lines, xlabel, ylabel):
    """lines: name -> (x, y); y from zero."""
    styles = looks(lines)
    for name, (x, y) in lines.items():
        axis.plot(x, y, styles[name][1], color=styles[name][0], label=name)
    axis.set(xlabel=xlabel, ylabel=ylabel, ylim=(0.0, None))


def page_lines(lines, xlabel, ylabel, is_map=False):
    """The same for a page."""
    styles = looks(lines)
    figure = go.Figure([go.Scatter(x=x, y=y, name=name, mode="lines", line={"color": styles[name][0], "dash": styles[name][2]})
                        for name, (x, y) in lines.items()])
    return figure.update_layout(PAGE, xaxis_title=xlabel, yaxis={"title": ylabel} | ({"scaleanchor": "x"} if is_map else {"rangemode": "tozero"}),
                                height=520 if is_map else 320)


def page_paths(paths, axes_of=None):
    first, second = axes_of or plane_of(np.concatenate(list(paths.values())))
    return page_lines({name: (at[:, first], at[:, second]) for name, at in paths.items()}, f"{'xyz'[first]}, m", f"{'xyz'[second]}, m", True)


def page_bars(bars, title):
    """bars: name -> (groups, values). They start at zero, so their lengths can be compared."""
    styles = looks(bars)
    figure = go.Figure([go.Bar(x=values, y=groups, name=name, orientation="h", marker_color=styles[name][0],
                               marker_pattern_shape=("", "/", "x", ".")[index // len(COLORS) % 4])
                        for index, (name, (groups, values)) in enumerate(bars.items())])
    count = sum(len(values) for _, values in bars.values())
    return figure.update_layout(PAGE, xaxis={"title": title, "rangemode": "tozero"}, yaxis={"autorange": "reversed", "type": "category"}, height=120 + 18 * count)
