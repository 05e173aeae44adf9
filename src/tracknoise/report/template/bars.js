/** Items of all lines in a panel, one list for each line. */
function lines(group) {
  return group.items.flatMap((mark) => {
    if (mark.marktype === "line") {
      return [mark.items];
    }
    return mark.marktype === "group" ? mark.items.flatMap(lines) : [];
  });
}

/** The panel of a figure that an item is in. */
function panelOf(item) {
  const group = item?.mark?.marktype === "group" ? item : item?.mark?.group;
  return !group || /^(concat|panel)_\d+_group$/.test(group.mark.name ?? "") ? group : panelOf(group.mark.group);
}

/** The bar of a histogram at the pointer: of several histograms in a panel, the one whose top is the nearest. */
function barAt(view, event, item) {
  const panel = panelOf(item);
  const bars = panel ? lines(panel).filter((items) => items.length && isBar(items[0].datum)) : [];
  if (!bars.length) {
    return undefined;
  }
  const [x, y] = placeIn(panel, view, event);
  const tops = bars.map((items) => pointAt(items, x));
  return tops.reduce((best, one) => (Math.abs(one.y - y) < Math.abs(best.y - y) ? one : best)).datum;
}

/** Whether a row is that of a histogram of lifetimes, or of largest errors. */
function isBar(row) {
  return "tracker" in row && "n" in row && ("lifetime" in row || ("of" in row && "to" in row));
}

/** Tracks with pictures that a bar counts, each once, the largest error first. The last bar of errors has no upper end. */
function tracksIn(bar) {
  const to = bar.to ?? Infinity;
  const inside = (track) =>
    "lifetime" in bar ? track.lifetime === bar.lifetime : track.largest !== null && bar.of <= track.largest && track.largest < to;
  const own = looked.groups.filter((group) => group.tracker === bar.tracker);
  const all = own.flatMap((group) => group.tracks.filter(inside).map((track) => ({ group, track })));
  const each = new Map(all.map((one) => [JSON.stringify([one.group.scene, one.track.track]), one]));
  return [...each.values()].sort((a, b) => b.track.largest - a.track.largest);
}

/** The worst, middle and best of a list of tracks that begins with the worst. */
function thirds(tracks) {
  const most = Math.min(MOST_OF_A_KIND, Math.ceil(tracks.length / 3));
  const rest = tracks.slice(most, Math.max(most, tracks.length - most));
  const from = Math.max(0, Math.floor((rest.length - MOST_OF_A_KIND) / 2));
  const parts = { worst: tracks.slice(0, most), median: rest.slice(from, from + MOST_OF_A_KIND) };
  parts.best = tracks.slice(most + rest.length);
  return Object.entries(parts).flatMap(([kind, some]) =>
    some.map(({ group, track }) => ({ group, track: { ...track, kind } })));
}

/** Show the tracks of a bar of a histogram. */
function lookAtBar(bar) {
  const place = document.getElementById("looks");
  const range = bar.to === null ? `${bar.of} px on` : `${bar.of} to ${bar.to} px`;
  const what = "lifetime" in bar ? `lifetime ${bar.lifetime}` : `largest error from ${range}`;
  const isShown = String(bar.speed) === String(explored.start.speed);
  const pictured = isShown ? tracksIn(bar) : [];
  const tracks = thirds(pictured);
  const none = isShown ? "No track with pictures is in this bar." : `Pictures are of speed ${explored.start.speed}.`;
  const grid = element("div", "tracks", tracks.length ? "" : none);
  grid.append(...tracks.map(card));
  const some = tracks.length < pictured.length ? `; ${tracks.length} of these are shown` : "";
  const note = element("p", "", `Tracks in this bar: ${bar.n}. With pictures: ${pictured.length}${some}.`);
  place.replaceChildren(element("h4", "", `${bar.tracker}, ${what}`), note, grid);
  place.dataset.shown = JSON.stringify(bar);
  place.scrollIntoView({ block: "nearest" });
}

/** Let bars of histograms open their tracks. */
function openBars(view) {
  view.addEventListener("click", (event, item) => {
    const bar = looked.groups.length ? barAt(view, event, item) : undefined;
    if (bar) {
      lookAtBar(bar);
    }
  });
}
