// SPDX-License-Identifier: MIT
// report.html of a search: {rows, paths, has_intervals, is_exhaustive, sequences, images, table, ..}; `rows` are the filters that found
// a pose, by rank.

// A filter's point says this when it is hovered over.
function filter_text(row) {
  const part = (name, value, unit) => (value === null ? "" : `\n${name} ${Number(value.toPrecision(3))} ${unit}`);
  return row.name + part("t_rel", row.t_rel, "%") + part("r_rel", row.r_rel, "deg/100 m") + part("inliers", row.inliers, "") +
         part("tracked", row.tracked, "of the frames");
}

// Points of the rows that have both numbers, a trace for each thing that became of them.
function filter_traces({ rows, has_intervals }, x_of, y_of, has_bars = false) {
  const names = [has_intervals ? "equal to the best" : "filter", "worse than the best", "baseline", "stopped early"];
  const group_of = (row) => (row.is_baseline ? 2 : row.is_stopped ? 3 : row.is_equal ? 0 : 1);
  const points = rows.map((row) => ({ row, x: x_of(row), y: y_of(row) })).filter(({ x, y }) => x !== null && y !== null);
  return names.map((name, group) => {
    const shown = points.filter(({ row }) => group_of(row) === group);
    const bars = has_bars ? { error_y: interval_bars(shown.map(({ row }) => row.over_best)) } : {};
    return { name, mode: "markers", marker: { size: 8 }, hoverinfo: "text", x: shown.map(({ x }) => x), y: shown.map(({ y }) => y),
             text: shown.map(({ row }) => filter_text(row)), ...bars };
  }).filter((trace) => trace.x.length > 0);
}

function search_subtitle({ num_rows, sequences, is_exhaustive, rows }) {
  const ranges = sequences.map(({ name, first, end, held_out }) => `${name} ${first}:${end}${held_out ? " (held out)" : ""}`);
  return `${num_rows} rows; frames ${ranges.join(", ")}; ${is_exhaustive ? "every filter over every frame" : "successive halving"}` +
         (rows[0]?.is_baseline ? `; the baseline ${rows[0].name} ranks before it` : "");
}

function search_page(search) {
  const ranks = new Map(search.rows.filter((row) => !row.is_stopped).map((row, i) => [row, i + 1]));
  const t_rel = (row) => row.t_rel;
  const sections = [
    { heading: "Filters by rank",
      note: search.has_intervals ? "Bars are 95 % intervals; filters whose bar holds 1 cannot be told from the best."
                                 : "The path is too short for 95 % intervals, which say what is worse than the best.",
      traces: filter_traces(search, (row) => ranks.get(row) ?? null, (row) => row.over_best.ratio, search.has_intervals),
      layout: { xaxis: titled("rank"), yaxis: logarithmic("error, times the best's") } },
    { heading: "Error and matches", note: "Of filters stopped early: over the frames they ran.",
      traces: filter_traces(search, (row) => row.inliers, t_rel),
      layout: { xaxis: titled("inliers per frame"), yaxis: titled("t_rel, %", 2) } },
    search.sequences.at(-1).held_out && {
      heading: "On the sequence that did not rank", traces: filter_traces(search, t_rel, (row) => row.held_out_t_rel),
      layout: { xaxis: titled("t_rel, %", 2), yaxis: titled("t_rel held out, %") } },
    search.truth && paths_from_above("Paths from above", `Of ${search.sequences[0].name}, each step of its true length.`,
      [{ name: TRUTH, ...search.truth }, ...search.paths.map(({ name, xz, is_baseline }) =>
        ({ name, x: xz.map(([x]) => x), z: xz.map(([, z]) => z), dotted: is_baseline }))]),
    search.images.length > 0 && { heading: "Channels", images: search.images },
    { heading: "All filters", text: search.table },
    ...how_to_repeat(search, "Configuration of all rows"),
  ];
  return { title: search.best === null ? "Search" : `Best filter: ${search.best}`, subtitle: search_subtitle(search), sections };
}
