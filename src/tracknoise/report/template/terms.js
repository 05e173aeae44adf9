const glossary = JSON.parse(document.getElementById("glossary").textContent);
const defined = new RegExp(`\\b(${Object.keys(glossary).sort((a, b) => b.length - a.length).join("|")})\\b`, "i");

/** A word that shows its definition where a reader points at it, taps it, or comes to it by the keyboard. */
function term(word) {
  const made = element("span", "term", word);
  const definition = Object.entries(glossary).find(([name]) => name.toLowerCase() === word.toLowerCase())[1];
  made.tabIndex = 0;
  made.dataset.definition = definition;
  made.setAttribute("role", "note");
  made.setAttribute("aria-label", `${word}: ${definition}`);
  return made;
}

/** Give the first occurrence of each word of the glossary on the first screen its definition. */
function defineTerms() {
  const screen = document.getElementById("answer");
  screen.querySelectorAll(".term[role]").forEach((one) => one.replaceWith(one.textContent));
  screen.normalize();
  const left = new Set(Object.keys(glossary).map((name) => name.toLowerCase()));
  const walker = document.createTreeWalker(screen, NodeFilter.SHOW_TEXT);
  const texts = [];
  while (walker.nextNode()) {
    const within = walker.currentNode.parentElement;
    if (within.checkVisibility() && !within.closest("h1, h2, select, button, a, svg, .term, tbody th")) {
      texts.push(walker.currentNode);
    }
  }
  for (let text of texts) {
    for (let found = defined.exec(text.data); found; found = defined.exec(text.data)) {
      const rest = text.splitText(found.index);
      text = rest.splitText(found[0].length);
      if (left.delete(found[0].toLowerCase())) {
        rest.replaceWith(term(rest.data));
      }
    }
  }
}

document.addEventListener("rewritten", defineTerms);
window.addEventListener("resize", defineTerms);
defineTerms();
