// SPDX-License-Identifier: MIT
// Draws what the page's function makes of the content that the program put into it.

const pages = { run: run_page };
const dark = matchMedia("(prefers-color-scheme: dark)");
const figures = [];  // {section, div}
let frames = [], small_frames = [];  // a line of text for each, where there is a slider; images of some

function element(parent, name, text, attributes) {
  const made = Object.assign(document.createElement(name), attributes || {});
  if (text !== undefined) made.textContent = text;
  return parent.appendChild(made);
}

// plotly.js takes some HTML in names, hover texts and categories: here every letter is itself, and a new line is one.
function literal(value) {
  const letters = { "&": "&amp;", "<": "&lt;", ">": "&gt;", "\n": "<br>" };
  if (typeof value === "string") return value.replace(/[&<>\n]/g, (letter) => letters[letter]);
  if (Array.isArray(value)) return value.map(literal);
  return value instanceof Object ? Object.fromEntries(Object.entries(value).map(([key, part]) => [key, literal(part)])) : value;
}

// Colours that are told apart without red or green (Okabe and Ito), as far as they stand on the page's ground.
function theme() {
  const style = getComputedStyle(document.documentElement), colour = (name) => style.getPropertyValue(name).trim();
  const axis = { gridcolor: colour("--line"), zerolinecolor: colour("--line"), linecolor: colour("--line"), automargin: true };
  const space = { gridcolor: colour("--line"), zerolinecolor: colour("--line"), backgroundcolor: colour("--back") };
  return { paper_bgcolor: colour("--back"), plot_bgcolor: colour("--back"),
    font: { color: colour("--ink"), family: "system-ui, sans-serif", size: 13 },
    colorway: dark.matches ? ["#56b4e9", "#e69f00", "#009e73", "#f0e442", "#cc79a7", "#d55e00"]
                           : ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"],
    margin: { l: 60, r: 20, t: 20, b: 50 }, hovermode: "closest",
    legend: { orientation: "h", y: 1.02, yanchor: "bottom", traceorder: "normal" }, hoverlabel: { namelength: -1 },
    template: { layout: { xaxis: axis, yaxis: axis, scene: { xaxis: space, yaxis: space, zaxis: space } } } };
}

// Maps take the wheel. A finger goes on scrolling the page: the buttons make it move a map, a tap makes it turn a space.
const touch = matchMedia("(hover: none)").matches;
function is_space(section) { return "scene" in section.layout; }
function follows_frames(section) { return section.frame_trace >= 0; }
function is_plan(layout) { return layout.yaxis?.scaleanchor !== undefined; }
function is_map(section) { return section.layout.dragmode === "pan" || is_space(section); }

// One colour for a name in all figures of the page; in a figure none twice while there are enough.
const places = new Map();
function colours_of(section, palette) {
  const used = new Set(section.traces.map((trace) => places.get(trace.name)));
  for (const { name, line } of section.traces) {
    if (places.has(name) || line?.color) continue;
    const free = palette.findIndex((_, place) => !used.has(place));
    places.set(name, free < 0 ? places.size % palette.length : free);
    used.add(places.get(name));
  }
  return section.traces.map(({ name, line }) => line?.color || palette[places.get(name)]);
}

// As far away as shows the whole box and the texts around it; the layout says from where.
function stand_back({ aspectratio, camera: { eye } }, div) {
  const length = (of) => Math.hypot(...Object.values(of)), texts = Math.min(50, div.clientHeight / 10);  // pixels
  const visible = Math.min(div.clientWidth, div.clientHeight) / 2;
  const half_angle = Math.atan(Math.tan(Math.PI / 8) * 2 * visible / div.clientHeight);
  const factor = length(aspectratio) / 2 / Math.sin(half_angle) * visible / (visible - texts) / length(eye);
  for (const axis in eye) eye[axis] *= factor;
}

function layout_of(section, div) {
  const layout = Object.assign(theme(), structuredClone(section.layout)), is_phone = div.clientWidth < 500;
  if (is_space(section)) {
    layout.margin = { l: 0, r: 0, t: 20, b: 0 };
    stand_back(layout.scene, div);
    if (Math.min(div.clientWidth, div.clientHeight) < 500)
      for (const axis of ["xaxis", "yaxis", "zaxis"]) {
        Object.assign(layout.scene[axis], { nticks: 4, tickfont: { size: 10 } });
        layout.scene[axis].title.font = { size: 11 };
      }
  }
  if (is_phone) {
    for (const [key, axis] of Object.entries(layout)) {
      if (/^[xy]axis/.test(key) && axis.title) axis.title.font = { size: 13 };
      if (/^xaxis/.test(key) && axis.type === "log") Object.assign(axis, { nticks: 3, tickangle: 0 });
    }
  }
  layout.colorway = colours_of(section, layout.colorway);
  if (touch && !is_space(section)) layout.dragmode = false;
  if (is_phone && layout.grid) {  // upright: below each other
    [layout.grid.rows, layout.grid.columns] = [layout.grid.columns, layout.grid.rows];
    layout.grid.ygap = 0.3;
  }
  return layout;
}

function extent(traces, axis) {
  const values = traces.flatMap((trace) => trace[axis]).filter(Number.isFinite);
  return values.reduce((a, b) => Math.max(a, b), -Infinity) - values.reduce((a, b) => Math.min(a, b), Infinity);
}

// A plot without what the legend and the texts take: as high as its layout says; of paths from above, their shape, as large as
// the page and the window let it be.
function fit_plot({ layout, traces }, div) {
  const { t, b, l, r } = div._fullLayout._size;
  let height = layout.plot_height, width = div.parentElement.clientWidth - l - r;
  if (is_plan(layout)) {
    const x = extent(traces, "x"), y = extent(traces, "y"), slimmest = 0.6, highest = Math.max(360, Math.min(0.75 * innerHeight, 700)) - t - b;
    const aspect = Math.min(Math.max(x / Math.max(y, 1e-9), slimmest), 1 / slimmest);  // width over height
    height = Math.min(width / aspect, highest);
    width = Math.max(height * aspect, Math.min(width, height));  // a slim one lets the legend and the buttons have their place
  }
  const size = { width: Math.ceil(width + l + r), height: Math.ceil(height + t + b) };
  if (Math.abs(size.width - div.clientWidth) + Math.abs(size.height - div.clientHeight) < 3) return;
  for (const side in size) div.style[side] = size[side] + "px";
  Plotly.Plots.resize(div);
}

function ink() { return getComputedStyle(document.documentElement).getPropertyValue("--ink").trim(); }

function cursor(section) {
  const { type, xaxis, yaxis } = section.traces[section.frame_trace], color = ink();
  const point = { name: "frame chosen", showlegend: false, hoverinfo: "skip", mode: "markers", x: [], y: [] };
  return type === "scatter3d" ? { ...point, type, z: [], text: [], hoverinfo: "text", marker: { size: 5, color } }  // it lies over what it marks
                              : { ...point, xaxis, yaxis, marker: { size: 12, color, symbol: "circle-open", line: { width: 3 } } };
}

function add_figure(parent, drawn) {
  const section = { ...drawn, traces: literal(drawn.traces), layout: literal(drawn.layout) };
  if (section.note) element(parent, "p", section.note);
  const kinds = { large: section.layout.large, space: is_space(section), grid: section.layout.grid };
  const div = element(parent, "div", undefined, { role: "img", ariaLabel: section.heading,
    className: ["figure", ...Object.keys(kinds).filter((kind) => kinds[kind])].join(" ") });
  const traces = follows_frames(section) ? section.traces.concat(cursor(section)) : section.traces;
  Plotly.newPlot(div, traces, layout_of(section, div), { responsive: true, scrollZoom: is_map(section), displaylogo: false,
                                                         modeBarButtonsToRemove: ["select2d", "lasso2d"] });
  figures.push({ section, div });
  if (section.layout.plot_height || is_plan(section.layout)) {
    const fit = () => fit_plot(section, div);
    div.on("plotly_afterplot", fit);
    addEventListener("resize", fit);
    fit();
  }
  for (const [key, axis] of Object.entries(section.layout))
    if (axis.type === "log" && div._fullLayout[key].dtick === "D1")
      Plotly.relayout(div, { [key + ".dtick"]: axis.dtick = "D2" });  // 1, 2, 5, 10
  if (touch && is_space(section)) {
    div.classList.add("still");
    document.addEventListener("touchstart", (event) => div.classList.toggle("still", !div.contains(event.target)), { passive: true });
  }
  if (follows_frames(section)) {
    const point_at = ({ points }) => {
      const point = points.find((found) => found.curveNumber === section.frame_trace) ?? points[0];
      const k = point.customdata ?? (point.data.x.length === frames.length ? point.pointNumber : chosen);
      if (k !== chosen) requestAnimationFrame(() => choose(k));  // later: drawing a space tells of the hover again
    };
    for (const event of ["plotly_hover", "plotly_click"]) div.on(event, point_at);  // a finger's tap is a click alone
  }
}

function add_images(parent, section) {
  const grid = element(parent, "div", undefined, { className: "images" });
  for (const image of section.images) {
    const figure = element(grid, "figure");
    element(figure, "img", undefined, { src: "data:image/jpeg;base64," + image.jpeg, alt: image.caption });
    element(figure, "figcaption", image.caption);
  }
}

function add_section(section) {
  const main = document.querySelector("main");
  const parent = element(main, "section");
  if (section.folded) {
    const fold = element(parent, "details");
    element(fold, "summary", section.heading);
    element(fold, "pre", section.text);
    return;
  }
  element(parent, "h2", section.heading);
  if (section.traces) add_figure(parent, section);
  else if (section.text !== undefined) element(parent, "pre", section.text);
  else add_images(parent, section);
}

function show_frame(kept) {
  const image = document.querySelector("#frames img");
  if (kept && kept.caption !== image.alt) Object.assign(image, { src: "data:image/jpeg;base64," + kept.jpeg, alt: kept.caption, title: kept.caption });
}

const slider = document.getElementById("frame");
let chosen = -1;
function choose(k) {
  slider.value = chosen = k;
  document.querySelector("#frames output").textContent = frames[k];
  show_frame(small_frames.findLast(({ row }) => row <= k) ?? small_frames[0]);
  for (const { section, div } of figures) {
    if (!follows_frames(section)) continue;
    const trace = section.traces[section.frame_trace], at = { x: [[trace.x[k]]], y: [[trace.y[k]]] };
    if (trace.z) Object.assign(at, { z: [[trace.z[k]]], text: [[trace.text[k]]] });
    Plotly.restyle(div, at, [section.traces.length]);
  }
}

function draw_again() {
  for (const { section, div } of figures) {
    if (follows_frames(section)) Plotly.restyle(div, { "marker.color": ink() }, [section.traces.length]);
    Plotly.relayout(div, layout_of(section, div));
  }
}

async function unpack(id) {
  const bytes = Uint8Array.from(atob(document.getElementById(id).textContent), (c) => c.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
}

async function show() {
  const content = JSON.parse(document.getElementById("content").textContent);
  const shown = pages[content.page](content);
  document.title = shown.title + " - stemvo";
  document.getElementById("title").textContent = shown.title;
  document.getElementById("subtitle").textContent = shown.subtitle;
  element(document.head, "script", await unpack("plotly"));
  frames = shown.frames ?? [];
  small_frames = content.small_frames ?? [];
  shown.sections.filter(Boolean).forEach(add_section);
  if (frames.length > 0) {
    document.getElementById("frames").hidden = false;
    slider.max = frames.length - 1;
    slider.addEventListener("input", () => choose(Number(slider.value)));
    choose(0);
  }
  for (const media of [dark, matchMedia("(max-width: 530px)")])  // the ground's colour, the phone's side
    media.addEventListener("change", () => setTimeout(draw_again, 300));  // when plotly.js, which waits 100 ms, has taken the new size
  document.body.dataset.shown = "yes";
}
show().catch((error) => { element(document.querySelector("main"), "p", "This browser cannot draw the figures: " + error); throw error; });
