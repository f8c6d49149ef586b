// Many outputs: a field among the contents finds them by their names.

import { element } from "./dom.js";

const FEW = 12;

/** Begin: of more than a dozen outputs, those whose names contain every typed word are shown. */
export function startSearch() {
  const contents = document.querySelector("main > nav");
  const outputs = [...document.querySelectorAll("section.output")].map((section, k) => ({
    section,
    name: section.querySelector("h3").textContent.trim(),
    link: contents?.querySelectorAll(".minor li")[k],
  }));
  if (!contents || outputs.length <= FEW) return;
  const rows = [...document.querySelectorAll("#outputs > .wide tbody tr, #outputs > details:not(.group) .wide tbody tr")];
  const groups = [...document.querySelectorAll("#outputs > .group")];
  const list = contents.querySelector(".minor").closest("details");
  const field = element("input", { type: "search", id: "find-output", autocomplete: "off" });
  const found = element("span", { class: "soft", role: "status" });
  const box = element("p", { class: "find", role: "search" }, element("label", { for: "find-output" }, "Find an output"), " ", field, " ", found);
  const matching = () => {
    const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
    return (name) => words.every((word) => name.toLowerCase().includes(word));
  };
  field.addEventListener("input", () => {
    const matches = matching();
    const typed = field.value.trim() !== "";
    outputs.forEach(({ section, name, link }) => (section.hidden = link.hidden = !matches(name)));
    rows.forEach((row) => (row.hidden = !matches(row.cells[0].textContent)));
    for (const group of groups) {
      group.hidden = ![...group.querySelectorAll("section.output")].some((section) => !section.hidden);
      group.open = typed && !group.hidden;
    }
    list.open = typed;
    const count = outputs.filter(({ section }) => !section.hidden).length;
    found.textContent = typed ? `${count} of ${outputs.length} outputs` : "";
  });
  // Enter goes to the first one, unfolded
  field.addEventListener("keydown", (event) => {
    const first = outputs.find(({ section }) => !section.hidden);
    if (event.key !== "Enter" || !first) return;
    // the rest of this key would fold it again
    event.preventDefault();
    const details = first.section.querySelector("details");
    details.open = true;
    first.section.scrollIntoView();
    details.querySelector("summary").focus();
  });
  list.before(box);
}
