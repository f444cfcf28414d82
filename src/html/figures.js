// SPDX-License-Identifier: MIT
// Parts of the figures of several pages. A section is {heading, text, folded}, {heading, images} or a figure:
// {heading, note, traces, layout, frame_trace}. Traces and layout are those of plotly.js' reference, without colours and fonts,
// which are the page's, for light and dark. The layout may also say `large`, `small` (several stand beside each other) or
// `plot_height` (pixels without what the legend and the texts take). The k-th point of trace `frame_trace` is frame k of the slider.

function titled(title, hover_digits) {
  return { title: { text: title }, ...(hover_digits === undefined ? {} : { hoverformat: `.${hover_digits}f` }) };
}

function logarithmic(title) {
  return { ...titled(title), type: "log", tickformat: "~g" };
}

const TRUTH = "ground truth";

// Paths are {name, x, z}, where wanted with `dotted` (told from another of its colour) and `texts` (a line for each frame).
function paths_from_above(heading, note, paths, unit = "m") {
  const traces = paths.map(({ name, x, z, dotted, texts }) => ({
    name, x, y: z,
    line: name === TRUTH ? { width: 5, color: "#999999" } : dotted ? { width: 2, dash: "dot" } : { width: 2 },
    ...(texts ? { mode: "lines+markers", marker: { size: 4 }, hoverinfo: "text", text: texts } : { mode: "lines" }),
  }));
  const layout = { large: true, dragmode: "pan", xaxis: titled(`x (right), ${unit}`, 3),
                   yaxis: { ...titled(`z (forward), ${unit}`, 3), scaleanchor: "x" } };
  return { heading, note, traces, layout, frame_trace: paths.findIndex((path) => path.texts) };
}

// The command, where there is one, and the configuration folded away.
function how_to_repeat({ command, configuration }, heading) {
  return [command && { heading: "Command", text: command }, { heading, text: configuration, folded: true }];
}
