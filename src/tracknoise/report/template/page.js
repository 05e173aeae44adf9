"use strict";

/** The specification of a figure, as the page holds it. */
function specification(name) {
  return JSON.parse(document.getElementById(`spec-${name}`).textContent);
}

/** Draw a specification in the page. To screen readers it is one thing, which its place describes. */
async function embed(place, spec) {
  const [config, role] = [{ ...spec.config, aria: false }, place.getAttribute("role")];
  const result = await vegaEmbed(place, { ...spec, background: "transparent", config }, { actions: false, renderer: "svg" });
  [...place.children].forEach((one) => one.setAttribute("aria-hidden", "true"));
  place.setAttribute("role", role);
  return result;
}

/** Draw a figure once. */
async function draw(chart) {
  if (chart.dataset.drawn) {
    return;
  }
  chart.dataset.drawn = "begun";
  try {
    const result = await embed(chart, specification(chart.dataset.figure));
    openBars(result.view);
    chart.style.minHeight = 0;
    chart.dataset.drawn = "yes";
  } catch (error) {
    chart.textContent = `This figure could not be drawn: ${error.message}`;
  }
}

/** A specification with the colours of paper in place of those of the page, which are names in its style. */
function onPaper(spec) {
  const light = { ink: "#1b2430", quiet: "#5b6775", grid: "#e3e7ec", axis: "#9aa5b1", paper: "#ffffff" };
  const text = JSON.stringify(spec).replace(/var\(--(\w+)\)/g, (whole, name) => light[name] ?? whole);
  return { ...JSON.parse(text), background: "#ffffff" };
}

/** Save a figure as SVG or PNG. */
async function savePicture(name, spec, kind) {
  const place = document.createElement("div");
  const { view, finalize } = await vegaEmbed(place, onPaper(spec), { actions: false, renderer: "svg" });
  if (kind === "svg") {
    save(`${name}.svg`, await view.toSVG(), "image/svg+xml");
  } else {
    const canvas = await view.toCanvas(2);
    await new Promise((done) => canvas.toBlob((blob) => done(save(`${name}.png`, blob, "image/png"))));
  }
  finalize();
}

/** Text as a file that the reader saves. */
function save(name, text, kind) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type: kind }));
  link.download = name;
  link.click();
  URL.revokeObjectURL(link.href);
}

/** The tables that a figure draws, without its pictures, as one text. */
function tables(name) {
  const sets = Object.entries(specification(name).datasets).filter(([key]) => key !== "image");
  const written = sets.map(([, rows]) => (typeof rows === "string" ? rows : `${JSON.stringify(rows)}\n`));
  return written.join("\n");
}

/** Figures that are open from the start. */
function openFigures() {
  return [...document.querySelectorAll("section.open [data-figure]")];
}

/** Draw open figures while the reader does nothing, and every figure that comes near the window. */
function drawAll() {
  const near = new IntersectionObserver(
    (entries) => entries.filter((entry) => entry.isIntersecting).forEach((entry) => draw(entry.target)),
    { rootMargin: "600px" },
  );
  document.querySelectorAll("[data-figure]").forEach((chart) => near.observe(chart));
  const idle = window.requestIdleCallback ?? ((work) => setTimeout(work, 50));
  const next = async () => {
    const chart = openFigures().find((one) => !one.dataset.drawn);
    if (chart) {
      await draw(chart);
      idle(next);
    }
  };
  idle(next);
}

/** Unfold what a link leads into, and go there when the figures above it have their heights. */
async function arrive() {
  const target = document.getElementById(decodeURIComponent(location.hash.slice(1).split("?")[0]));
  for (let one = target?.closest("details"); one; one = one.parentElement.closest("details")) {
    one.open = true;
  }
  if (!target) {
    return;
  }
  if (target.closest("[hidden]")) {
    document.querySelector("#search [name=words]").value = "";
    search("");
  }
  let moved = false;
  const note = () => { moved = true; };
  ["wheel", "touchmove", "keydown"].forEach((name) => addEventListener(name, note, { once: true, passive: true }));
  target.scrollIntoView({ behavior: "instant" });
  const above = (chart) => chart.compareDocumentPosition(target) & Node.DOCUMENT_POSITION_FOLLOWING;
  await Promise.all(openFigures().filter(above).map(draw));
  if (!moved) {
    target.scrollIntoView({ behavior: "instant" });
  }
  document.body.dataset.arrived = target.id;
}

/** Show the entries and figures that hold all words of the search. */
function search(text) {
  const words = text.toLowerCase().split(/\s+/).filter(Boolean);
  const holds = (one) => words.every((word) => one.textContent.toLowerCase().includes(word));
  const entries = [...document.querySelectorAll("#entries > .entry")];
  for (const entry of entries) {
    const figures = [...entry.querySelectorAll("figure")];
    const found = figures.filter(holds);
    entry.hidden = !holds(entry);
    figures.forEach((one) => { one.hidden = found.length > 0 && !found.includes(one); });
  }
  const n = entries.filter((entry) => !entry.hidden).length;
  document.getElementById("hits").textContent = words.length ? `${n} of ${entries.length}` : "";
}

document.addEventListener("click", (event) => {
  const { download, picture, kind } = event.target.dataset ?? {};
  if (download) {
    save(`${download}.csv`, tables(download), "text/csv");
  } else if (picture) {
    savePicture(picture, specification(picture), kind);
  }
});
document.getElementById("search").addEventListener("input", (event) => search(event.target.value));
document.getElementById("search").addEventListener("submit", (event) => event.preventDefault());
window.addEventListener("hashchange", arrive);
window.addEventListener("beforeprint", () => openFigures().forEach(draw));
drawAll();
arrive();
if (matchMedia("(max-width: 1000px)").matches) {
  document.querySelector("nav details").open = false;
}
