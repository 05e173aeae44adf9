/** The exports of all models, unpacked when they are first needed. */
let unpacked = null;

function unpack() {
  const packed = Uint8Array.from(atob(document.getElementById("noise-exports").textContent), (sign) => sign.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).json();
}

/** Copy text. Pages from disk may lack the clipboard of the browser: a selection is copied then. */
async function copy(text) {
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    const area = document.createElement("textarea");
    area.value = text;
    document.body.append(area);
    area.focus();
    area.select();
    const copied = document.execCommand("copy");
    area.remove();
    if (!copied) {
      throw new Error("the browser does not allow it");
    }
  }
}

/** Copy text, and say on a button whether that succeeded. */
async function copyAndSay(button, text) {
  try {
    await copy(text);
    button.textContent = "Copied";
    return true;
  } catch (error) {
    button.textContent = `Not copied: ${error.message}`;
    return false;
  }
}

/** A button that copies text, and says so. */
function copyButton(name, text) {
  const button = element("button", "copy", "Copy");
  button.type = "button";
  button.setAttribute("aria-label", `Copy ${name}`);
  button.addEventListener("click", () => copyAndSay(button, text));
  return button;
}

/** Text to copy, under its name. */
function exportedFile(name, text) {
  const made = element("div", "exported");
  const heading = element("p", "file");
  heading.append(element("strong", "", name), " ", copyButton(name, text));
  const code = document.createElement("pre");
  code.tabIndex = 0;
  code.setAttribute("role", "region");
  code.setAttribute("aria-label", name);
  code.append(element("code", "", text));
  made.append(heading, code);
  return made;
}

/** An element with text in which parts between backticks are code. */
function marked(name, text, kind = "") {
  const made = element(name, kind);
  made.append(...text.split("`").map((part, place) => (place % 2 ? element("code", "", part) : part)));
  return made;
}

/** What an export is: lines of facts, then sentences. Its title and first line are those of the files above. */
function exportedText(text) {
  const [facts, sentences = ""] = text.slice(text.indexOf("\n\n")).trim().split(/\n\n- /);
  const list = document.createElement("ul");
  list.append(...sentences.split("\n- ").filter(Boolean).map((sentence) => marked("li", sentence)));
  const made = document.createElement("div");
  made.append(marked("p", facts, "facts"), list);
  return made;
}

/** Show what to write for the chosen estimator. */
async function showExport(form) {
  const place = document.getElementById("exported");
  try {
    unpacked ??= await unpack();
  } catch (error) {
    place.replaceChildren(element("p", "absent", `The exports could not be read: ${error.message}. Use tracknoise export.`));
    return;
  }
  const found = unpacked.files[form.tracker.value][form.estimator.value];
  const parts = found.files
    ? [...found.files.map(([name, text]) => exportedFile(name, text)), exportedText(found.text)]
    : [marked("p", found.why, "absent"), ...(found.command ? [exportedFile("command", found.command)] : [])];
  place.replaceChildren(...parts);
  place.dataset.shown = `${form.tracker.value} ${form.estimator.value}`;
}

/** What a change of the estimator, its windows or its features changes on the first screen. */
class Chooser {
  constructor(form) {
    this.form = form;
    this.rows = [...document.querySelectorAll("[data-set]")];
    this.first = form.estimator.value;
    form.addEventListener("submit", (event) => event.preventDefault());
    form.addEventListener("change", (event) => this.pick(event.target.name));
    document.querySelector("#answer").addEventListener("click", (event) => {
      if (event.target.dataset?.copy) {
        this.copyFile(event.target);
      }
    });
    this.start();
  }

  async start() {
    try {
      unpacked ??= await unpack();
    } catch {
      document.querySelectorAll("[data-copy]").forEach((one) => { one.disabled = true; });
      this.form.estimator.disabled = true;
      return;
    }
    this.offer();
    this.showCopies();
  }

  /** What can be set in the chosen estimator: an entry for each number of features. */
  get settings() {
    return unpacked.settings[unpacked.kinds[this.form.estimator.value]] ?? [];
  }

  get chosen() {
    return this.settings[Number(this.form.features.value)];
  }

  /** Offer the windows and features of the chosen estimator. */
  offer() {
    const { window, features } = this.form;
    const list = this.settings;
    features.replaceChildren(...list.map((one, place) => new Option(one.features ? `of ${one.features} features` : "ignored", place)));
    features.parentElement.hidden = list.length < 2;
    const lengths = Object.keys(list[0]?.windows ?? {});
    window.replaceChildren(...lengths.map((length) => new Option(length, length)));
    window.parentElement.hidden = lengths.length < 2;
    if (list.length) {
      window.value = list[0].window;
    }
    document.dispatchEvent(new Event("rewritten"));
  }

  pick(name) {
    if (!unpacked) {
      return;
    }
    if (name === "estimator") {
      this.offer();
      exportForm.estimator.value = this.form.estimator.value;
      showExport(exportForm);
    }
    this.show();
  }

  /** Show sigmas, the heading and the curves. */
  show() {
    const { chosen, form } = this;
    const shown = chosen?.windows[form.window.value];
    const why = unpacked.files[this.rows[0]?.dataset.set]?.[form.estimator.value]?.why ? "no export" : "no single sigma";
    for (const row of this.rows) {
      const [sigma, interval, limit, innovations] = shown?.rows[row.dataset.set] ?? ["", "", why, ""];
      const cell = row.querySelector(".sigma");
      const most = cell.querySelector(".most");
      const inBoard = Boolean(row.closest(".board"));
      const ends = inBoard && interval ? `[${interval}]` : interval;
      cell.replaceChildren(element("b", "", sigma || (inBoard ? why : "")), " ", most ?? element("span", "ends", ends));
      cell.dataset.key = Number.parseFloat(sigma);
      row.querySelector(".limit")?.replaceChildren(limit);
      row.querySelector(".innovations")?.replaceChildren(innovations);
    }
    const parts = { heading: shown?.heading, why: shown?.why, lines: shown?.key, leader: shown?.leader };
    for (const [name, text] of Object.entries(parts)) {
      const place = document.querySelector(`#answer [data-${name}]`);
      if (place) {
        place.textContent = text ?? "";
        place.hidden = !text;
      }
    }
    const plotted = document.querySelector("#answer .plotted");
    if (plotted) {
      plotted.innerHTML = chosen?.plot ?? "";
      plotted.querySelectorAll(".dots").forEach((dots) => {
        dots.setAttribute("display", dots.dataset.window === form.window.value ? "inline" : "none");
      });
    }
    this.showCopies();
    document.dispatchEvent(new Event("rewritten"));
  }

  /** Whether the file is for the windows that are chosen: otherwise a command writes it. */
  get isShipped() {
    const [first] = this.settings;
    return !first || (this.chosen === first && this.form.window.value === String(first.window));
  }

  showCopies() {
    const name = this.form.estimator.value;
    for (const button of document.querySelectorAll("[data-copy]")) {
      const found = unpacked.files[button.dataset.copy][name];
      const file = found?.files?.[0][0];
      button.disabled = !file || (!this.isShipped && this.chosen !== this.settings[0]);
      button.textContent = this.isShipped ? "Copy" : "Copy command";
      button.title = button.disabled && file ? "State features in [estimator] of the experiment file." : file ?? found?.why ?? "";
      button.setAttribute("aria-label", `${button.textContent} ${file ?? name} for ${button.dataset.copy}`);
    }
  }

  /** Copy the file of a tracker for the chosen estimator, or the command that writes it; say so on the button. */
  async copyFile(button) {
    const name = this.form.estimator.value;
    const [file, text] = unpacked.files[button.dataset.copy][name].files[0];
    const command = `tracknoise export ${unpacked.paths[button.dataset.copy]} --to ${name} --window ${this.form.window.value}`;
    if (await copyAndSay(button, this.isShipped ? text : command)) {
      button.title = this.isShipped ? file : command;
    }
  }
}

const exportForm = document.getElementById("export");
const chooser = document.getElementById("choose");
if (exportForm) {
  exportForm.addEventListener("change", () => showExport(exportForm));
  exportForm.addEventListener("submit", (event) => event.preventDefault());
  showExport(exportForm);
}
if (chooser) {
  window.chooser = new Chooser(chooser);
}
