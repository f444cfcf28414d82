// SPDX-License-Identifier: MIT
// report.html of a benchmark: {report: what benchmark.json holds, with the words and paths of its sequences and runs, table, ..}.

// One measure of every sequence, a bar per run; published numbers beside them.
function bars_of({ sequences }, key, title) {
  const traces = new Map();
  for (const { name: sequence, frames_text, runs, published } of sequences)
    for (const row of [...runs, ...published.map((one) => ({ ...one, text: one.method ?? "published" }))]) {
      if (typeof row[key] !== "number") continue;
      if (!traces.has(row.text)) traces.set(row.text, { name: row.text, type: "bar", orientation: "h", x: [], y: [] });
      traces.get(row.text).x.push(row[key]);
      traces.get(row.text).y.push(`${sequence}, ${frames_text}`);
    }
  const num_bars = [...traces.values()].reduce((sum, { x }) => sum + x.length, 0);
  const layout = { plot_height: 60 + 22 * num_bars, xaxis: logarithmic(title), yaxis: { type: "category", autorange: "reversed" } };
  return num_bars > 0 && { heading: title, traces: [...traces.values()], layout };
}

function benchmark_page(content) {
  const { report } = content;
  const sections = [
    bars_of(report, "t_rel_percent", "t_rel, %"),
    bars_of(report, "r_rel_deg_per_100m", "r_rel, deg/100 m"),
    ...report.sequences.filter(({ paths }) => paths?.some(({ name }) => name !== TRUTH)).map(({ name, frames_text, paths }) =>
      paths_from_above(`${name}, ${frames_text}`, "Nothing is aligned afterwards.", paths)),
    { heading: "All numbers", text: content.table, folded: true },
    ...how_to_repeat(content, "Configurations"),
  ];
  return { title: "Benchmark", subtitle: `stemvo ${report.stemvo_version}${report.interrupted ? ", interrupted" : ""}`, sections };
}
