"use strict";
(async () => {
  for (const chart of document.querySelectorAll("[data-figure]")) {
    const spec = JSON.parse(document.getElementById(`spec-${chart.dataset.figure}`).textContent);
    try {
      await vegaEmbed(chart, spec, { actions: false, renderer: "svg" });
      chart.dataset.drawn = "yes";
    } catch (error) {
      chart.textContent = `This figure could not be drawn: ${error.message}`;
    }
  }
})();
