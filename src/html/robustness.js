// SPDX-License-Identifier: MIT
// report.html of a robustness run: {report: what robustness.json holds, contenders, table, ..}; the first contender is judged.

const UNDISTURBED = "none";

// The judged channel's rotation error over each control's, a row per disturbance and strength.
function ratios_to_controls({ report, contenders }) {
  const label = ({ disturbance, strength }) => (disturbance === UNDISTURBED ? "as the frames are" : `${disturbance} ${strength}`);
  const traces = contenders.slice(1).map((name, control) => {
    const found = report.rows.map((row) => ({ label: label(row), ...row.channels[control + 1].rotation_ratio }))
      .filter(({ low, high }) => high !== null && low > 0);
    return { name, mode: "markers", x: found.map(({ ratio }) => ratio), y: found.map((one) => one.label), error_x: interval_bars(found),
             ...(control > 0 ? { visible: "legendonly" } : {}) };
  });
  const layout = { plot_height: 19 * report.rows.length, dragmode: "pan", xaxis: logarithmic("error, times the control's"),
                   yaxis: { autorange: "reversed", dtick: 1 },
                   shapes: [{ type: "line", yref: "paper", x0: 1, x1: 1, y0: 0, y1: 1, line: { width: 1, color: "#999999" } }] };
  return { heading: "Against the controls", traces, layout,
           note: `${contenders[0]} is better left of 1. Bars are 95 % intervals; where one holds 1 the two cannot be told apart. ` +
                 "Choose controls in the legend." };
}

// Error over strength for each disturbance, after the undisturbed frames; those alone only where there is no other.
function panels_of({ report, contenders }) {
  const names = [...new Set(report.rows.map((row) => row.disturbance))];
  return names.filter((name) => name !== UNDISTURBED || names.length === 1).map((name) => {
    const rows = report.rows.filter(({ disturbance }) => disturbance === UNDISTURBED || disturbance === name);
    const x = rows.map(({ disturbance, strength }) => (disturbance === UNDISTURBED ? UNDISTURBED : String(strength)));
    const traces = contenders.map((channel, i) => ({ name: channel, mode: "lines+markers", line: { width: i === 0 ? 4 : 2 }, x,
                                                     y: rows.map((row) => row.channels[i].r_rel_deg_per_100m) }));
    return { heading: name === UNDISTURBED ? "as the frames are" : name, traces,
             layout: { small: true, xaxis: { type: "category" }, yaxis: logarithmic("degrees per 100 m") } };
  });
}

function robustness_page(content) {
  const { report, contenders } = content;
  const sections = [contenders.length > 1 && ratios_to_controls(content), ...panels_of(content),
                    { heading: "All numbers", text: content.table, folded: true },
                    ...how_to_repeat(content, "Configuration of the judged channel")];
  return { title: `Robustness of ${contenders[0]}`, subtitle: `drives ${report.drives.join(", ")}; rotation errors r_rel`, sections };
}
