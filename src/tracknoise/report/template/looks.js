const ENLARGED = 4;
const MOST_OF_A_KIND = 8;
const ARROW = 18;
const INSET = 3;

const looked = JSON.parse(document.getElementById("looked").textContent);
const tile = looked.patch_px * ENLARGED;

/** An element with classes and text. */
function element(name, kind, text = "") {
  const made = document.createElement(name);
  made.className = kind;
  made.textContent = text;
  return made;
}

/** An element of SVG with attributes. */
function drawing(name, attributes) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) {
    made.setAttribute(key, value);
  }
  return made;
}

/** Length of the error of a track, px. */
function length(track) {
  return Math.hypot(...track.error);
}

/** The largest, middle and smallest of what groups hold; each group holds its own ones. */
function selected(groups) {
  const every = groups.flatMap((group) => group.tracks.map((track) => ({ group, track })));
  if (groups.length < 2) {
    return every;
  }
  const of = (kind, compare) => every.filter(({ track }) => track.kind === kind).sort(compare).slice(0, MOST_OF_A_KIND);
  const rising = (a, b) => length(a.track) - length(b.track);
  const middles = every.filter(({ track }) => track.kind === "median").sort(rising);
  const from = Math.max(0, Math.floor((middles.length - MOST_OF_A_KIND) / 2));
  return [...of("worst", (a, b) => rising(b, a)), ...middles.slice(from, from + MOST_OF_A_KIND), ...of("best", rising)];
}

/**
 * The mark of the true place in the second patch, whose middle is the nearest pixel of the observed place: a circle, or,
 * where the true place is outside the patch, an arrow that ends at its border and points from the observed place to it.
 */
function trueMark([x, y], [trueX, trueY]) {
  if (tile <= trueX && trueX <= 2 * tile && trueY >= 0 && trueY <= tile) {
    return drawing("circle", { cx: trueX, cy: trueY, r: 5, fill: "none", stroke: "#fff", "stroke-width": 2 });
  }
  const [du, dv] = [trueX - x, trueY - y];
  const reach = (from, step, low) => ((step > 0 ? low + tile - INSET : low + INSET) - from) / step;
  const share = Math.min(...[reach(x, du, tile), reach(y, dv, 0)].map(Math.abs));
  const [tipX, tipY] = [x + share * du, y + share * dv];
  const size = Math.hypot(du, dv);
  const [along, across] = [[du / size, dv / size], [-dv / size, du / size]];
  const corner = (back, side) => [0, 1].map((at) => [tipX, tipY][at] - back * along[at] + side * across[at]).join(",");
  const wings = [1, -1].map((side) => corner(ARROW / 2, (side * ARROW) / 3));
  const head = corner(0, 0);
  return drawing("path", { class: "beyond", d: `M${corner(ARROW, 0)}L${head}M${wings[0]}L${head}L${wings[1]}`, fill: "none",
    stroke: "#fff", "stroke-width": 2 });
}

/** Both patches of a track, with the observed and the true place. */
function patches(group, track) {
  const [u, v] = track.within;
  const [du, dv] = track.error;
  const middle = tile / 2;
  const picture = element("div", "patches");
  const rows = group.tracks.length;
  picture.style.cssText = `width:${2 * tile}px;height:${tile}px;`
    + `background:url(data:image/webp;base64,${group.sheet}) 0 ${-track.row * tile}px / ${2 * tile}px ${rows * tile}px`;
  const over = drawing("svg", { viewBox: `0 0 ${2 * tile} ${tile}`, width: 2 * tile, height: tile, "aria-hidden": "true" });
  const [x, y] = [tile + middle + ENLARGED * u, middle + ENLARGED * v];
  const now = drawing("svg", { viewBox: `${tile} 0 ${tile} ${tile}`, x: tile, width: tile, height: tile, overflow: "hidden" });
  now.append(
    drawing("path", { d: `M${x - 6},${y}h12M${x},${y - 6}v12`, stroke: "#fff", "stroke-width": 1.5 }),
    trueMark([x, y], [x - ENLARGED * du, y - ENLARGED * dv]),
  );
  over.append(
    drawing("path", { d: `M${middle - 6},${middle}h12M${middle},${middle - 6}v12`, stroke: "#fff", "stroke-width": 1.5 }),
    now,
  );
  picture.append(over);
  return picture;
}

/** The path of the error from zero to now. */
function path(track) {
  const [du, dv] = [track.path.du_px, track.path.dv_px];
  const reach = Math.max(1e-9, ...du.map(Math.abs), ...dv.map(Math.abs));
  const place = (values) => values.map((value, at) => `${at * (200 / Math.max(1, values.length - 1))},${15 - (13 * value) / reach}`);
  const shape = drawing("svg", { viewBox: "0 0 200 30", width: 200, height: 30, role: "img",
    "aria-label": `error in u and v, up to ${Number(reach.toPrecision(3))} px` });
  shape.append(drawing("line", { x1: 0, x2: 200, y1: 15, y2: 15, stroke: "var(--axis)" }));
  for (const [values, dash] of [[du, "none"], [dv, "3 2"]]) {
    shape.append(drawing("polyline", { points: place(values).join(" "), fill: "none", stroke: "var(--ink)", "stroke-width": 1.5,
      "stroke-dasharray": dash }));
  }
  return shape;
}

/** A track with its patches, path and facts. */
function card({ group, track }) {
  const made = element("figure", "track");
  made.dataset.track = track.track;
  made.dataset.scene = group.scene;
  made.dataset.kind = track.kind;
  const size = Number(length(track).toPrecision(3));
  made.append(
    patches(group, track),
    path(track),
    element("figcaption", "", `${track.kind}: ${size} px. Scene ${group.scene}, track ${track.track}, frames `
      + `${track.anchor_frame} to ${track.frame}. Ended: ${track.end}. Truth: ${track.truth}.`),
  );
  return made;
}

/** The worst track as a loop of patches. */
function strip(group) {
  const made = element("div", "strip");
  made.setAttribute("role", "img");
  made.setAttribute("aria-label", `the worst track in ${group.strip_at.length} frames`);
  made.style.cssText = `width:${tile}px;height:${tile}px;--tile:${tile}px;--frames:${group.strip_at.length};`
    + `background:url(data:image/webp;base64,${group.strip}) 0 0 / ${group.strip_at.length * tile}px ${tile}px`;
  return made;
}

/** Groups of a tracker: of one scene, or of all, at the nearest age that has pictures. */
function groupsAt(tracker, scene, at) {
  const own = looked.groups.filter((group) => group.tracker === tracker && (scene === "all" || group.scene === scene));
  const places = [...new Set(own.map((group) => group.at))];
  const nearest = places.reduce((best, one) => (Math.abs(one - at) < Math.abs(best - at) ? one : best), places[0]);
  return own.filter((group) => group.at === nearest);
}

/** Show the tracks of a point. */
function look(tracker, scene, at) {
  const groups = groupsAt(tracker, scene, Number(at));
  const place = document.getElementById("looks");
  if (!groups.length) {
    place.replaceChildren(element("p", "absent", `This run has no pictures of ${tracker} there.`));
    return;
  }
  const tracks = selected(groups);
  const worst = tracks[0].group;
  const title = `${tracker}, ${scene === "all" ? "all scenes" : `scene ${scene}`}, at ${explored.axis} ${groups[0].at}`;
  const grid = element("div", "tracks");
  grid.append(...tracks.map(card));
  place.replaceChildren(element("h4", "", title), strip(worst), grid);
  place.dataset.shown = JSON.stringify({ tracker, scene, at: groups[0].at });
  for (const [name, value] of Object.entries({ tracker, scene, at: groups[0].at })) {
    document.querySelector(`#look [name=${name}]`).value = value;
  }
}

/** Controls for those who do not click on points. */
function lookControls() {
  const names = (key) => [...new Set(looked.groups.map((group) => group[key]))];
  const lists = { tracker: names("tracker"), scene: ["all", ...names("scene")], at: names("at").sort((a, b) => a - b) };
  const labels = Object.entries(lists).map(([name, values]) => {
    const label = element("label", "", name === "at" ? explored.axis : name);
    const select = document.createElement("select");
    select.name = name;
    values.forEach((value) => select.add(new Option(value, value)));
    label.append(select);
    return label;
  });
  const form = document.getElementById("look");
  form.replaceChildren(...labels);
  form.addEventListener("change", () => look(form.tracker.value, form.scene.value, form.at.value));
}

/** The point of a line that is drawn at a horizontal place. */
function pointAt(items, x) {
  if (items[0].interpolate === "step-after") {
    return items.findLast((one) => one.x <= x) ?? items[0];
  }
  return items.reduce((best, one) => (Math.abs(one.x - x) < Math.abs(best.x - x) ? one : best));
}

/** Where the pointer is within a group of a figure. */
function placeIn(group, view, event) {
  const box = view.container().querySelector("svg").getBoundingClientRect();
  const [left, top] = view.origin();
  let [x, y] = [event.clientX - box.left - left, event.clientY - box.top - top];
  for (let one = group; one; one = one.mark?.group) {
    x -= one.x ?? 0;
    y -= one.y ?? 0;
  }
  return [x, y];
}

/** The row that was clicked: that of a mark, or of a line at the place of the pointer. */
function clicked(view, event, item) {
  if (item?.mark?.marktype !== "line") {
    return item?.datum;
  }
  return pointAt(item.mark.items, placeIn(item.mark.group, view, event)[0]).datum;
}

/** Let points and lines of a figure of the explorer open their tracks. */
function openOnClick(view) {
  view.addEventListener("click", (event, item) => {
    const row = clicked(view, event, item);
    if (row && "scene" in row && "tracker" in row) {
      look(row.tracker, row.scene === "pooled" ? "all" : row.scene, row.at);
      document.getElementById("looks").scrollIntoView({ block: "nearest" });
    }
  });
}

if (looked.groups.length) {
  lookControls();
}
