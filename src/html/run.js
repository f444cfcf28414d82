// SPDX-License-Identifier: MIT
// report.html of a run: {title, subtitle, unit, frames_csv, estimate, map, truth, segments, metrics, numbers, stages, images, ..}.

function columns_of(csv) {
  const [names, ...rows] = csv.trimEnd().split("\n").map((line) => line.split(","));
  const value = (cell) => (cell === "" ? null : Number.isNaN(Number(cell)) ? cell : Number(cell));
  return Object.fromEntries(names.map((name, column) => [name, rows.map((row) => value(row[column]))]));
}

function distance(a, i, b, j) {
  return Math.hypot(a.x[i] - b.x[j], a.y[i] - b.y[j], a.z[i] - b.z[j]);
}

// As the program's tables have it.
function length_text(metres, digits) {
  return 1e-4 <= metres && metres < 1 ? String(Number(metres.toPrecision(3))) : metres.toFixed(digits);
}

// Per frame the true path so far, how far off and how much too high the estimate is; NaN where there is no true pose.
function errors_of(estimate, truth) {
  const unknown = () => estimate.x.map(() => NaN), errors = { travelled: unknown(), position: unknown(), height: unknown() };
  let travelled = 0;
  truth.frames.forEach((frame, i) => {
    travelled += i > 0 ? distance(truth, i, truth, i - 1) : 0;
    errors.travelled[frame] = travelled;
    errors.position[frame] = distance(estimate, frame, truth, i);
    errors.height[frame] = truth.y[i] - estimate.y[frame];
  });
  return errors;
}

function range_of(values) {
  return [values.reduce((a, b) => Math.min(a, b)), values.reduce((a, b) => Math.max(a, b))];
}

// In each axis a little more than the paths take. True to scale, but no axis so short that its ticks run into each other.
function scene_around(traces) {
  const margin = 0.15, shortest = 0.45;
  const boxes = ["x", "y", "z"].map((axis) => {
    const values = traces.flatMap((trace) => trace[axis]).concat(0);
    const [low, high] = range_of(values);
    return { axis, middle: (low + high) / 2, size: high - low };
  });
  const longest = Math.max(...boxes.map(({ size }) => size)), scene = { camera: { eye: { x: -2, y: -2, z: 1.8 } }, aspectratio: {} };
  for (const { axis, middle, size } of boxes) {
    const shown = Math.max(size, 1e-3 + 1e-3 * longest), half = (0.5 + margin) * shown;
    scene.aspectratio[axis] = Math.max(shown / Math.max(longest, 1e-3), shortest);
    scene[axis + "axis"] = { nticks: 5, range: [middle - half, middle + half] };
  }
  return scene;
}

function path_in_space(paths, unit) {
  const traces = paths.map(({ name, x, y, z, ...path }) => ({
    name, type: "scatter3d", mode: "lines", x, y: z, z: y.map((down) => -down), ...labels_of(path),
    line: { width: 4, ...(name === TRUTH ? { color: "#999999" } : {}) },
  }));
  const scene = scene_around(traces);
  const titles = { xaxis: "right", yaxis: "forward", zaxis: "up" };
  for (const [axis, title] of Object.entries(titles)) Object.assign(scene[axis], titled(`${title}, ${unit}`));
  return { heading: "Path in space", note: "Short axes are stretched: heights are what the ticks say.", traces,
           layout: { large: true, scene }, frame_trace: traces.length - 1 };
}

function errors_over_distance({ travelled, position, height }, in_map, labels) {
  const has_gaps = travelled.some(Number.isNaN), mode = has_gaps ? "lines+markers" : "lines";
  const traces = [
    { name: "position", y: position, ...labels },
    { name: "height, too high is above 0", y: height },
    ...(in_map ? [{ name: "position in the map", y: in_map.position }] : []),
  ].map((trace) => ({ ...trace, x: travelled, mode, connectgaps: has_gaps }));
  const layout = { xaxis: titled("true path, m", 3), yaxis: titled("error, m", 3) };
  return { heading: "Error over distance", traces, layout, frame_trace: 0 };
}

function errors_by_length(segments) {
  const lengths = [...new Set(segments.length_m)].sort((a, b) => a - b), is_trend = lengths.length > 2;
  const traces = [["t_rel", segments.t_percent, ""], ["r_rel", segments.r_deg_per_100m, "2"]].flatMap(([name, errors, number]) => {
    const mean = (length) => {
      const some = errors.filter((_, i) => segments.length_m[i] === length);
      return some.reduce((sum, error) => sum + error, 0) / some.length;
    };
    const mark = is_trend ? { mode: "lines+markers" } : { mode: "markers", marker: { size: 10, symbol: "diamond" } };  // two are no trend
    return [{ name: `${name} of a segment`, mode: "markers", opacity: 0.4, x: segments.length_m, y: errors },
            { name: `${name}, mean`, ...mark, x: lengths, y: lengths.map(mean) }]
      .map((trace) => ({ ...trace, xaxis: "x" + number, yaxis: "y" + number }));
  });
  const layout = { grid: { rows: 1, columns: 2, pattern: "independent" }, xaxis: { ...titled("segment, m"), tickvals: lengths }, xaxis2: { ...titled("segment, m"), tickvals: lengths },
                   yaxis: titled("t_rel, %", 2), yaxis2: titled("r_rel, deg/100 m", 3) };
  return { heading: "Error by segment length", note: "KITTI's segments, from every tenth frame.", traces, layout };
}

// The same axis in each figure.
function frames_axis({ frame }) {
  const first = frame[0], last = frame[frame.length - 1], margin = 0.02 * (last - first) + 0.5;
  return { ...titled("frame"), range: [first - margin, last + margin] };
}

// Panels, {axis, traces}, from the top down above one axis of frames; the legend has their order.
function stacked(frames, panels) {
  const gap = 0.06, layout = { plot_height: 150 * panels.length, hovermode: "x unified", xaxis: { ...frames_axis(frames), anchor: "y" } };
  const traces = panels.flatMap(({ axis, traces }, i) => {
    const above = panels.length - 1 - i, number = above > 0 ? String(above + 1) : "";  // y is the lowest
    layout["yaxis" + number] = { ...axis, domain: [above / panels.length + (above > 0 ? gap : 0), (above + 1) / panels.length] };
    return traces.map((trace) => ({ mode: "lines", ...trace, x: frames.frame, yaxis: "y" + number }));
  });
  return { traces, layout };
}

function tracks(frames) {
  const is_scored = (k) => frames.s_h[k] + frames.s_f[k] > 0;
  const ratios = frames.r_h.map((ratio, k) => (is_scored(k) ? ratio : null)), scored = ratios.filter((ratio) => ratio !== null);
  const panels = [{ axis: titled("tracks"), traces: [{ name: "tracks", y: frames.matches }, { name: "inliers", y: frames.inliers }] },
                  { axis: { type: "category" }, traces: [{ name: "state", y: frames.state, mode: "markers" }] }];
  const has_scores = scored.length > 0.1 * ratios.length;  // a map has them until it starts
  if (has_scores) {
    const [low, high] = range_of(scored.concat(0.4, 0.5));  // where both models are level, too
    panels.splice(1, 0, { axis: { ...titled("R_H", 3), range: [low - 0.05, high + 0.05] }, traces: [{ name: "R_H", y: ratios, mode: "lines+markers" }] });
  }
  return { heading: has_scores ? "Tracks, model and state" : "Tracks and state", ...stacked(frames, panels), frame_trace: 0,
           note: has_scores && "R_H: score of the homography over that of both models." };
}

// How far a number of the camera has moved; around it one sigma, where it has one.
function learnt(frames, name, color, column) {
  const values = frames[column + "_px"], sigmas = frames[column + "_sigma_px"];
  const line = (sign, width) => ({ name, y: values.map((value, k) => value - values[0] + sign * sigmas[k]), line: { color, width } });
  if (sigmas[0] === null) return values.some((value) => value !== values[0]) ? [line(0, 2)] : [];
  const edge = { showlegend: false, hoverinfo: "skip" };
  return [{ ...line(-1, 0), ...edge }, { ...line(1, 0), ...edge, fill: "tonexty", fillcolor: color + "40" }, line(0, 2)];
}

function scale_and_camera(frames, estimate, unit) {
  const steps = estimate.x.map((_, k) => (k > 0 ? distance(estimate, k, estimate, k - 1) : null)), name = "length of a step";
  const panels = [{ axis: titled(`step, ${unit}`, 3), traces: [{ name, y: steps }] }];
  if (frames.scale_sigma.some((sigma) => sigma !== null)) {
    const percent = frames.scale_sigma.map((sigma) => sigma && 100 * sigma);
    panels.unshift({ axis: { ...logarithmic("sigma, %"), hoverformat: ".2f" },  // it begins with 100
                     traces: [{ name: "sigma of the scale", y: percent }] });
  }
  const camera = [...learnt(frames, "principal point, x", "#009e73", "cx"), ...learnt(frames, "principal point, y", "#cc79a7", "cy")];
  if (frames.fx_px.some((focal) => focal !== frames.fx_px[0])) camera.push(...learnt(frames, "focal length", "#e69f00", "fx"));
  if (camera.length > 0) panels.push({ axis: titled("moved by, px", 2), traces: camera });
  const { traces, layout } = stacked(frames, panels);
  return { heading: camera.length > 0 ? "Scale and camera" : "Scale", note: camera.length > 0 && "Shaded: one sigma, where the camera is learnt.",
           traces, layout, frame_trace: traces.findIndex((trace) => trace.name === name) };
}

function times(frames) {
  const traces = ["stem", "features", "pose"].map((stage) => ({ name: stage, x: frames.frame, y: frames[stage + "_ms"], mode: "lines" }));
  return { heading: "Time per stage", note: "Stages of different frames overlap: they do not add up to a frame's time.", traces,
           layout: { xaxis: frames_axis(frames), yaxis: titled("ms", 1), hovermode: "x unified" }, frame_trace: 0 };
}

// Lines between frames that show one place, on the path of the map.
function loops_of({ x, z, loops }) {
  const between = (axis) => loops.flatMap(([from, to]) => [axis[from], axis[to], null]);
  return { name: "loops", x: between(x), z: between(z), dotted: true };
}

// With a text for each point.
function labelled(path, frames, rows, unit) {
  const texts = rows.map((row, i) => `${path.name}, frame ${frames.frame[row]}: right ${length_text(path.x[i], 2)}, ` +
                                     `up ${length_text(-path.y[i], 2)}, forward ${length_text(path.z[i], 2)} ${unit}`);
  return { ...path, texts, rows };
}

function run_page(run) {
  const frames = columns_of(run.frames_csv), { unit } = run, rows = frames.frame.map((_, k) => k);
  const truth = run.truth && labelled({ name: TRUTH, ...run.truth }, frames, run.truth.frames, unit);
  const errors = truth && errors_of(run.estimate, truth);
  const texts = frames.frame.map((frame, k) => {
    const text = `frame ${frame}: ${frames.state[k]}, ${frames.inliers[k]} of ${frames.matches[k]} tracks are inliers`;
    const { position, travelled } = errors ?? { position: [] };
    return position[k] >= 0 ? `${text}, ${length_text(position[k], 2)} m off after ${length_text(travelled[k], 1)} m` : text;
  });
  const estimate = { name: "estimate", ...run.estimate, texts, rows };
  // Without a loop the map's path is the estimate.
  const is_other = run.map && rows.some((k) => distance(run.map, k, run.estimate, k) > 1e-3);
  const map = is_other && labelled({ name: "map", ...run.map }, frames, rows, unit);
  const paths = [truth, map, estimate].filter(Boolean), loops = map && map.loops.length > 0 ? [loops_of(map)] : [];
  const sections = [
    paths_from_above("Path from above", "With a mouse: drag to move, wheel (or + and -) to zoom, double click to see all.",
                     loops.concat(paths), unit),
    { heading: "Numbers", text: run.numbers },
    path_in_space(paths, unit),
    errors && errors_over_distance(errors, map && errors_of(map, truth), labels_of(estimate)),
    run.segments?.length_m.length > 0 && errors_by_length(run.segments),
    tracks(frames), scale_and_camera(frames, estimate, unit), times(frames),
    run.stages && { heading: "Stages", text: run.stages },
    run.images.length > 0 && { heading: "Frames and their channel", images: run.images },
    ...how_to_repeat(run, "Configuration"),
  ];
  return { title: run.title, subtitle: run.subtitle, frames: texts, sections };
}
