const EVERY = "all";
const FACTORS = ["tracker", "speed", "lighting", "rotation", "direction", "camera"];
const LABELS = {
  speed: (value) => `speed ${value}`,
  rotation: (value) => `${value}°`,
};
const SHADES = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#8a6d00", "#5b6775"];

const explored = JSON.parse(document.getElementById("explored").textContent);
const views = new Map();
let chosen = {};

/** The names of the controls that have a choice. */
function controls() {
  return Object.keys(explored.choices).filter((name) => name === "scene" || explored.choices[name].length > 1);
}

/** What is shown before the reader chooses. */
function start() {
  const first = { ...explored.start, tracker: EVERY, scene: "none" };
  return Object.fromEntries(Object.entries(first).map(([name, value]) => [name, String(value)]));
}

/** What the address says, where it names something that this run has. */
function fromAddress() {
  const query = location.hash.split("?")[1] ?? "";
  const known = [...new URLSearchParams(query)].filter(
    ([name, value]) => name in explored.choices && options(name).some(([one]) => one === value),
  );
  return { ...start(), ...Object.fromEntries(known) };
}

/** Values and labels of a control. */
function options(name) {
  const values = explored.choices[name].map((value) => [String(value), String(value)]);
  if (name === "scene") {
    return [["none", "pooled only"], [EVERY, "all scenes"], ...values];
  }
  return FACTORS.includes(name) ? [...values, [EVERY, "all"]] : values;
}

/** One control with its label. */
function control(name) {
  const label = document.createElement("label");
  const select = document.createElement("select");
  select.name = name;
  for (const [value, text] of options(name)) {
    select.add(new Option(text, value, false, chosen[name] === value));
  }
  label.append(name, select);
  return label;
}

/** Whether a curve is among those that were chosen. */
function isShown(curve) {
  return Object.entries(chosen).every(
    ([name, value]) => name === "scene" || !(name in curve) || value === EVERY || String(curve[name]) === value,
  );
}

/** What tells a curve from the others that are shown. */
function series(curve) {
  const several = FACTORS.filter((name) => chosen[name] === EVERY && explored.choices[name].length > 1);
  const parts = several.map((name) => (LABELS[name] ?? String)(curve[name]));
  return parts.join(", ") || String(curve.tracker);
}

/** A colour for every series: that of the tracker where these are compared alone. */
function palette(names) {
  const own = (name) => explored.colours[name];
  return new Map(names.map((name, place) => [name, own(name) ?? SHADES[place % SHADES.length]]));
}

/** Rows of the curves of one statistic in one coordinate. */
function rows(curves, role, coordinate, colours) {
  return curves.filter((curve) => curve[role]).flatMap((curve) => {
    const values = curve[role];
    const column = (name) => values[name] ?? [];
    return values.at.map((at, place) => ({
      at,
      value: column(coordinate)[place],
      low: column(`${coordinate}_low`)[place] ?? null,
      high: column(`${coordinate}_high`)[place] ?? null,
      n: values.n[place],
      series: series(curve),
      tracker: curve.tracker,
      scene: curve.scene ?? "pooled",
      colour: colours.get(series(curve)),
    }));
  });
}

/** Ends of the vertical axis: all curves, and intervals as far as they do not shrink these. */
function ends(table) {
  const values = table.map((row) => row.value).filter((value) => value !== null);
  const [low, high] = [Math.min(0, ...values), Math.max(0, ...values)];
  const reach = high - low || 1;
  const bounds = table.flatMap((row) => [row.low, row.high]).filter((value) => value !== null);
  return [
    Math.max(low - reach, Math.min(low, ...bounds)) - 0.04 * reach,
    Math.min(high + reach, Math.max(high, ...bounds)) + 0.04 * reach,
  ];
}

/** One panel: bands, scenes, curves and zero. */
function panel(pooled, scenes, domain, title) {
  const x = { field: "at", type: "quantitative", title: explored.title, scale: { nice: false } };
  const y = { field: "value", type: "quantitative", title: null, scale: { domain, nice: false } };
  const hue = { field: "colour", type: "nominal", scale: null };
  const tooltip = [
    ...["series", "scene"].map((field) => ({ field, type: "nominal" })),
    ...["at", "value", "low", "high", "n"].map((field) => ({ field, type: "quantitative", format: ".4~g" })),
  ];
  const band = { ...y, field: "low" };
  return {
    title,
    width: 400,
    height: 170,
    layer: [
      { data: { values: pooled.filter((row) => row.low !== null) }, mark: { type: "area", opacity: 0.15, clip: true },
        encoding: { x, y: band, y2: { field: "high" }, fill: hue, detail: { field: "series" } } },
      { data: { values: scenes }, mark: { type: "line", strokeWidth: 0.8, opacity: 0.5, clip: true },
        encoding: { x, y, stroke: hue, detail: [{ field: "series" }, { field: "scene" }], tooltip } },
      { data: { values: pooled }, mark: { type: "line", strokeWidth: 2, clip: true, point: { size: 26, filled: true } },
        encoding: { x, y, color: hue, detail: { field: "series" }, tooltip } },
      { data: { values: [{ value: 0 }] }, mark: { type: "rule", color: "#9aa5b1" }, encoding: { y } },
    ],
  };
}

/** The figure of one statistic for what was chosen. */
function figure(role) {
  const isSurvival = role === "survival";
  const pooled = (isSurvival ? explored.survival : explored.errors).filter(isShown);
  const wanted = (curve) => chosen.scene === EVERY || curve.scene === chosen.scene;
  const scenes = isSurvival || chosen.scene === "none" ? [] : explored.scenes.filter(isShown).filter(wanted);
  const colours = palette([...new Set([...pooled, ...scenes].map(series))]);
  const coordinates = isSurvival ? ["u"] : ["u", "v"];
  const drawn = coordinates.map((axis) => [rows(pooled, role, axis, colours), rows(scenes, role, axis, colours)]);
  const domain = ends(drawn.flat(2));
  const title = (axis) => (isSurvival ? "" : { u: "u (horizontal)", v: "v (vertical)" }[axis]);
  const panels = drawn.map(([one, other], place) => panel(one, other, domain, title(coordinates[place])));
  return {
    $schema: "https://vega.github.io/schema/vega-lite/v6.json",
    background: "#ffffff",
    config: { view: { stroke: null }, axis: { gridColor: "#e3e7ec", labelFontSize: 11 } },
    hconcat: panels,
    usermeta: { rows: drawn.flat(2), colours: [...colours] },
  };
}

/** Draw a figure of the explorer again. */
async function redraw(place) {
  const spec = figure(place.dataset.explorer);
  views.get(place.dataset.explorer)?.result.finalize();
  const result = await vegaEmbed(place, spec, { actions: false, renderer: "svg" });
  views.set(place.dataset.explorer, { result, spec });
  openOnClick(result.view);
  place.dataset.shown = JSON.stringify(chosen);
  const message = `${place.getAttribute("aria-label")}: ${spec.usermeta.rows.length} points of `;
  place.title = message + (spec.usermeta.colours.map(([name]) => name).join(", ") || "nothing");
}

/** Draw every figure of the explorer again. */
async function show() {
  await Promise.all([...document.querySelectorAll("[data-explorer]")].map(redraw));
  legend();
}

/** Names and colours of the curves; that there is none, if so. */
function legend() {
  const colours = [...views.values()].flatMap((one) => one.spec.usermeta.colours);
  const parts = [...new Map(colours)].map(([name, colour]) => {
    const mark = document.createElement("span");
    mark.style.color = colour;
    mark.textContent = "● ";
    const item = document.createElement("span");
    item.append(mark, `${name}  `);
    return item;
  });
  document.getElementById("legend").replaceChildren(...(parts.length ? parts : ["Nothing was measured for this choice."]));
}

/** Take over what the controls say. */
function choose(event) {
  chosen[event.target.name] = event.target.value;
  const changed = Object.entries(chosen).filter(([name, value]) => start()[name] !== value);
  const query = new URLSearchParams(changed).toString();
  history.replaceState(null, "", query ? `#explorer?${query}` : "#explorer");
  show();
}

/** Save a figure as it is shown, or its values. */
async function saveExplored(name, kind) {
  const { result, spec } = views.get(name);
  if (kind === "csv") {
    const columns = ["series", "scene", "at", "value", "low", "high", "n"];
    const quoted = (value) => (typeof value === "string" ? `"${value.replaceAll('"', '""')}"` : (value ?? ""));
    const lines = spec.usermeta.rows.map((row) => columns.map((column) => quoted(row[column])).join(","));
    save(`${name}.csv`, [columns.join(","), ...lines].join("\n"), "text/csv");
  } else if (kind === "svg") {
    save(`${name}.svg`, await result.view.toSVG(), "image/svg+xml");
  } else {
    const canvas = await result.view.toCanvas(2);
    canvas.toBlob((blob) => save(`${name}.png`, blob, "image/png"));
  }
}

/** Show what the address says. */
function restore() {
  chosen = fromAddress();
  document.getElementById("controls").replaceChildren(...controls().map(control));
  if (location.hash.startsWith("#explorer?")) {
    document.getElementById("explorer").scrollIntoView();
  }
  return show();
}

document.getElementById("controls").addEventListener("change", choose);
document.addEventListener("click", (event) => {
  const { save: name, kind } = event.target.dataset ?? {};
  if (name) {
    saveExplored(name, kind);
  }
});
window.addEventListener("hashchange", restore);
restore();
