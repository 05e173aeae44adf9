"use strict";

/** The specification of a figure, as the page holds it. */
function specification(name) {
  return JSON.parse(document.getElementById(`spec-${name}`).textContent);
}

/** Draw a figure once. */
async function draw(chart) {
  if (chart.dataset.drawn) {
    return;
  }
  chart.dataset.drawn = "begun";
  try {
    const result = await vegaEmbed(chart, specification(chart.dataset.figure), { actions: false, renderer: "svg" });
    openBars(result.view);
    chart.dataset.drawn = "yes";
  } catch (error) {
    chart.textContent = `This figure could not be drawn: ${error.message}`;
  }
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

/** Draw figures that are near the window at once, and the others while the reader does nothing. */
function drawAll() {
  const charts = [...document.querySelectorAll("[data-figure]")];
  const near = new IntersectionObserver(
    (entries) => entries.filter((entry) => entry.isIntersecting).forEach((entry) => draw(entry.target)),
    { rootMargin: "600px" },
  );
  charts.forEach((chart) => near.observe(chart));
  const idle = window.requestIdleCallback ?? ((work) => setTimeout(work, 50));
  const next = async () => {
    const chart = charts.find((one) => !one.dataset.drawn);
    if (chart) {
      await draw(chart);
      idle(next);
    }
  };
  idle(next);
}

/** Unfold what a link leads into. */
function unfold() {
  const target = document.getElementById(decodeURIComponent(location.hash.slice(1).split("?")[0]));
  for (let one = target?.closest("details"); one; one = one.parentElement.closest("details")) {
    one.open = true;
  }
}

document.addEventListener("click", (event) => {
  const name = event.target.dataset?.download;
  if (name) {
    save(`${name}.csv`, tables(name), "text/csv");
  }
});
window.addEventListener("hashchange", unfold);
window.addEventListener("beforeprint", () => document.querySelectorAll("[data-figure]").forEach(draw));
unfold();
drawAll();
