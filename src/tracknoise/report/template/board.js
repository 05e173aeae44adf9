/** The leaderboard: sorted by any column, and copied as a table of Markdown or LaTeX. */
class Board {
  constructor(table) {
    this.table = table;
    table.tHead.addEventListener("click", (event) => {
      const heading = event.target.closest("th");
      if (heading) {
        this.sort(heading);
      }
    });
    for (const button of document.querySelectorAll("[data-table]")) {
      button.addEventListener("click", () => copyAndSay(button, this[button.dataset.table]()));
    }
  }

  /** Sort rows by a column; a second time in the other direction. Rows without a value come last. */
  sort(heading) {
    const falls = heading.getAttribute("aria-sort") === "ascending";
    [...heading.parentElement.cells].forEach((cell) => cell.removeAttribute("aria-sort"));
    heading.setAttribute("aria-sort", falls ? "descending" : "ascending");
    const key = (row) => row.cells[heading.cellIndex].dataset.key;
    const isKnown = (row) => key(row) !== "" && key(row) !== "NaN";
    const compare = (a, b) =>
      isKnown(b) - isKnown(a) ||
      (falls ? -1 : 1) * (Number.isNaN(Number(key(a))) ? key(a).localeCompare(key(b)) : key(a) - key(b));
    const [body] = this.table.tBodies;
    body.append(...[...body.rows].sort(compare));
  }

  /** Texts of headings and rows, without the buttons to copy. */
  get texts() {
    const last = this.table.tHead.rows[0].cells.length - 1;
    return [...this.table.rows].map((row) => [...row.cells].slice(0, last).map((cell) => cell.innerText.trim().replace(/\s+/g, " ")));
  }

  markdown() {
    const [headings, ...rows] = this.texts.map((row) => row.map((text) => text.replaceAll("|", "\\|")));
    const rules = headings.map((_, place) => (place === 1 ? "---" : "--:"));
    return [headings, rules, ...rows].map((row) => `| ${row.join(" | ")} |`).join("\n");
  }

  latex() {
    const [headings, ...rows] = this.texts.map((row) => `${row.map((text) => text.replace(/[&%$#_{}]/g, "\\$&")).join(" & ")} \\\\`);
    const columns = [...this.table.tHead.rows[0].cells].slice(0, -1).map((_, place) => (place === 1 ? "l" : "r")).join("");
    return [`\\begin{tabular}{${columns}}`, "\\hline", headings, "\\hline", ...rows, "\\hline", "\\end{tabular}"].join("\n");
  }
}

const boardTable = document.querySelector("table.board");
if (boardTable) {
  window.board = new Board(boardTable);
}
