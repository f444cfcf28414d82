// SPDX-License-Identifier: MIT
// Parts of the figures of several pages. A section is {heading, text, folded}, {heading, images} or a figure:
// {heading, note, traces, layout, frame_trace}. Traces and layout are those of plotly.js' reference, without colours and fonts,
// which are the page's, for light and dark. The layout may also say `large` or
// `plot_height` (pixels without what the legend and the texts take). The k-th point of trace `frame_trace` is frame k of the slider.

function titled(title, hover_digits) {
  return { title: { text: title }, ...(hover_digits === undefined ? {} : { hoverformat: `.${hover_digits}f` }) };
}

function logarithmic(title) {
  return { ...titled(title), type: "log", tickformat: "~g" };
}

const TRUTH = "ground truth";

// Paths are {name, x, z}, where wanted with `dotted` (told from another of its colour), `texts` (of its points) and `rows` (their
// frames, which the slider goes to from there). The slider follows the last.
function paths_from_above(heading, note, paths, unit = "m") {
  const traces = paths.map((path) => ({
    name: path.name, x: path.x, y: path.z, ...labels_of(path),
    line: path.name === TRUTH ? { width: 5, color: "#999999" } : path.dotted ? { width: 2, dash: "dot" } : { width: 2 },
    ...(path === paths.at(-1) ? { mode: "lines+markers", marker: { size: 4 } } : { mode: "lines" }),
  }));
  const layout = { large: true, dragmode: "pan", xaxis: titled(`x (right), ${unit}`), yaxis: { ...titled(`z (forward), ${unit}`), scaleanchor: "x" } };
  return { heading, note, traces, layout, frame_trace: traces.length - 1 };
}

function labels_of({ texts, rows }) {
  return texts ? { hoverinfo: "text", text: texts.map((text) => text.replaceAll(", ", "\n")), customdata: rows } : { hoverinfo: "skip" };
}

// The command, where there is one, and the configuration folded away.
function how_to_repeat({ command, configuration }, heading) {
  return [command && { heading: "Command", text: command }, { heading, text: configuration, folded: true }];
}
