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

/** An element with text. */
function written(name, text, kind = "") {
  const made = document.createElement(name);
  made.className = kind;
  made.textContent = text;
  return made;
}

/** A button that copies text, and says so. */
function copyButton(name, text) {
  const button = written("button", "Copy", "copy");
  button.type = "button";
  button.setAttribute("aria-label", `Copy ${name}`);
  button.addEventListener("click", async () => {
    try {
      await copy(text);
      button.textContent = "Copied";
    } catch (error) {
      button.textContent = `Not copied: ${error.message}`;
    }
  });
  return button;
}

/** Text to copy, under its name. */
function exportedFile(name, text) {
  const made = written("div", "", "exported");
  const heading = written("p", "", "file");
  heading.append(written("strong", name), " ", copyButton(name, text));
  const code = document.createElement("pre");
  code.tabIndex = 0;
  code.setAttribute("role", "region");
  code.setAttribute("aria-label", name);
  code.append(written("code", text));
  made.append(heading, code);
  return made;
}

/** An element with text in which parts between backticks are code. */
function marked(name, text, kind = "") {
  const made = written(name, "", kind);
  made.append(...text.split("`").map((part, place) => (place % 2 ? written("code", part) : part)));
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
    place.replaceChildren(written("p", `The exports could not be read: ${error.message}. Use tracknoise export.`, "absent"));
    return;
  }
  const found = unpacked[form.tracker.value][form.estimator.value];
  const parts = found.files
    ? [...found.files.map(([name, text]) => exportedFile(name, text)), exportedText(found.text)]
    : [marked("p", found.why, "absent"), ...(found.command ? [exportedFile("command", found.command)] : [])];
  place.replaceChildren(...parts);
  place.dataset.shown = `${form.tracker.value} ${form.estimator.value}`;
}

/** Rows of the first screen as the page was written: they are those of the estimator of the experiment. */
const firstRows = new Map([...document.querySelectorAll("[data-set]")].map((row) => [row.dataset.set, row.innerHTML]));

/** Show what to set in an estimator on the first screen. */
async function showSettings(name, ofExperiment) {
  try {
    unpacked ??= await unpack();
  } catch {
    document.querySelectorAll("[data-copy]").forEach((one) => { one.disabled = true; });
    chooser.estimator.value = ofExperiment;
    chooser.estimator.disabled = true;
    return;
  }
  for (const row of document.querySelectorAll("[data-set]")) {
    const found = unpacked[row.dataset.set]?.[name];
    row.innerHTML = firstRows.get(row.dataset.set);
    const [, sigma, limit, innovations] = row.cells;
    if (name !== ofExperiment) {
      const [value, interval, more, expected] = found?.set ?? ["", "", found?.why ? "no export" : "no single sigma", ""];
      const most = row.querySelector(".most");
      sigma.replaceChildren(written("b", value), " ", most && found?.set ? most : written("span", most ? "" : interval, "ends"));
      limit.textContent = more;
      innovations.textContent = expected;
    }
    const copies = row.querySelector("[data-copy]");
    if (copies) {
      copies.disabled = !found?.files;
      copies.title = found?.files ? found.files[0][0] : (found?.why ?? "");
      copies.setAttribute("aria-label", `Copy ${found?.files?.[0][0] ?? name} for ${row.dataset.set}`);
    }
  }
}

/** Copy the file of a tracker for the chosen estimator, and say so on the button. */
async function copyFile(button, name) {
  const [file, text] = unpacked[button.dataset.copy][name].files[0];
  try {
    await copy(text);
    button.textContent = "Copied";
    button.title = file;
  } catch (error) {
    button.textContent = `Not copied: ${error.message}`;
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
  const first = chooser.estimator.value;
  chooser.addEventListener("submit", (event) => event.preventDefault());
  chooser.addEventListener("change", () => {
    exportForm.estimator.value = chooser.estimator.value;
    showExport(exportForm);
    showSettings(chooser.estimator.value, first);
  });
  document.querySelector(".settings").addEventListener("click", (event) => {
    if (event.target.dataset?.copy) {
      copyFile(event.target, chooser.estimator.value);
    }
  });
  showSettings(first, first);
}
