const EVERY = "all";
const FACTORS = ["tracker", "speed", "lighting", "rotation", "direction", "camera"];
const LABELS = {
  speed: (value) => `speed ${value}`,
  rotation: (value) => `${value}°`,
};
const SHADES = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#8a6d00", "#5b6775"];
const PANEL = { width: 400, height: 170 };

const explored = JSON.parse(document.getElementById("explored").textContent);
let shownView = null;
let chosen = {};
let picked = null;

/** The names of the controls that have a choice. */
function controls() {
  const several = Object.keys(explored.choices).filter((name) => name === "scene" || explored.choices[name].length > 1);
  return explored.charts.length > 1 ? ["statistic", ...several] : several;
}

/** What is shown before the reader chooses. */
function start() {
  const first = { ...explored.start, statistic: explored.charts[0].id, tracker: EVERY, scene: "none" };
  return Object.fromEntries(Object.entries(first).map(([name, value]) => [name, String(value)]));
}

/** What the address says, where it names something that this run has. */
function fromAddress() {
  const query = location.hash.split("?")[1] ?? "";
  const known = [...new URLSearchParams(query)].filter(
    ([name, value]) => controls().includes(name) && options(name).some(([one]) => one === value),
  );
  return { ...start(), ...Object.fromEntries(known) };
}

/** Values and labels of a control. */
function options(name) {
  if (name === "statistic") {
    return explored.charts.map((chart) => [chart.id, chart.title]);
  }
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

/** The statistic that is shown. */
function statistic() {
  return explored.charts.find((chart) => chart.id === chosen.statistic);
}

/** Whether a curve is among those that were chosen. */
function isShown(curve) {
  return Object.entries(chosen).every(
    ([name, value]) => name === "scene" || name === "statistic" || !(name in curve) || value === EVERY || String(curve[name]) === value,
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
      axis: role === "survival" ? "" : coordinate,
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
  const named = [...new Map(pooled.concat(scenes).map((row) => [row.series, row.colour]))];
  const scale = { domain: named.map(([name]) => name), range: named.map(([, colour]) => colour) };
  const hue = { field: "series", type: "nominal", scale, legend: null };
  const tooltip = [
    ...["series", "scene"].map((field) => ({ field, type: "nominal" })),
    ...["at", "value", "low", "high", "n"].map((field) => ({ field, type: "quantitative", format: ".4~g" })),
  ];
  const band = { ...y, field: "low" };
  return {
    title,
    ...PANEL,
    layer: [
      { data: { values: pooled.filter((row) => row.low !== null) }, mark: { type: "area", opacity: 0.15, clip: true },
        encoding: { x, y: band, y2: { field: "high" }, fill: hue, detail: { field: "series" } } },
      { data: { values: scenes }, mark: { type: "line", strokeWidth: 0.8, opacity: 0.5, clip: true },
        encoding: { x, y, stroke: hue, detail: [{ field: "series" }, { field: "scene" }], tooltip } },
      { data: { values: pooled }, mark: { type: "line", strokeWidth: 2, clip: true, point: { size: 26, filled: true } },
        encoding: { x, y, color: hue, detail: { field: "series" }, tooltip } },
      { data: { values: [{ value: 0 }] }, mark: { type: "rule", color: "var(--axis)" }, encoding: { y } },
    ].filter((one) => one.data.values.length), // an axis without a value has no range
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
    config: {
      view: { stroke: null },
      axis: { gridColor: "var(--grid)", domainColor: "var(--axis)", tickColor: "var(--axis)", labelColor: "var(--quiet)", titleColor: "var(--ink)",
        labelFontSize: 12, titleFontSize: 12 },
      title: { color: "var(--ink)", fontSize: 12, anchor: "start" },
    },
    hconcat: panels,
    usermeta: { rows: drawn.flat(2), colours: [...colours] },
  };
}

/** Draw the figure again. */
async function show() {
  const place = document.querySelector("[data-explorer]");
  const chart = statistic();
  const spec = figure(chart.id);
  document.getElementById("explorer-title").textContent = chart.title;
  document.getElementById("explorer-what-if").textContent = chart.what_if;
  shownView?.result.finalize();
  const result = await embed(place, spec);
  shownView = { result, spec };
  openOnClick(result.view);
  pick(null);
  place.dataset.shown = JSON.stringify(chosen);
  legend();
}

/** Names and colours of the curves; that there is none, if so. */
function legend() {
  const parts = [...new Map(shownView.spec.usermeta.colours)].map(([name, colour]) => {
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

/** Points of the drawn curves in the order in which arrow keys move: by curve, then along it. */
function curvesDrawn() {
  const points = shownView.spec.usermeta.rows;
  const places = [...new Set(points.map((row) => `${row.axis} ${row.series} ${row.scene}`))];
  return places.map((place) => points.filter((row) => `${row.axis} ${row.series} ${row.scene}` === place));
}

/** Say which point the arrow keys have reached. */
function pick(found) {
  picked = found;
  const row = found && curvesDrawn()[found[0]][found[1]];
  const digits = (value) => Number(value.toPrecision(3));
  const bounds = row && row.low !== null ? ` (${digits(row.low)} to ${digits(row.high)})` : "";
  const where = row && [row.series, row.scene, row.axis].filter(Boolean).join(", ");
  document.getElementById("point").textContent = row ? `${where}, ${explored.axis} ${row.at}: ${digits(row.value)}${bounds}` : "";
}

/** Move among points with the arrow keys; Enter opens the tracks. */
function steer(event) {
  const steps = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] };
  const drawn = curvesDrawn();
  if (event.key === "Enter" && picked) {
    const row = drawn[picked[0]][picked[1]];
    look(row.tracker, row.scene === "pooled" ? "all" : row.scene, row.at);
  } else if (steps[event.key] && drawn.length) {
    const [curve, point] = picked ? picked.map((at, axis) => at + steps[event.key][axis]) : [0, 0];
    const line = (curve + drawn.length) % drawn.length;
    pick([line, Math.min(Math.max(point, 0), drawn[line].length - 1)]);
  } else {
    return;
  }
  event.preventDefault();
}

/** Save the figure as it is shown, or its values. */
function saveExplored(kind) {
  const name = chosen.statistic;
  if (kind !== "csv") {
    const keyed = JSON.stringify({ ...shownView.spec, title: statistic().title }).replaceAll('"legend":null', '"legend":{"title":null,"symbolOpacity":1}');
    return savePicture(name, JSON.parse(keyed), kind);
  }
  const columns = ["series", "scene", "axis", "at", "value", "low", "high", "n"];
  const quoted = (value) => (typeof value === "string" ? `"${value.replaceAll('"', '""')}"` : (value ?? ""));
  const lines = shownView.spec.usermeta.rows.map((row) => columns.map((column) => quoted(row[column])).join(","));
  return save(`${name}.csv`, [columns.join(","), ...lines].join("\n"), "text/csv");
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
document.querySelector("[data-explorer]").addEventListener("keydown", steer);
document.addEventListener("click", (event) => {
  const kind = event.target.dataset?.save;
  if (kind) {
    saveExplored(kind);
  }
});
window.addEventListener("hashchange", restore);
restore();
