// SPDX-License-Identifier: MIT
// log.js - who asked for what, and what became of it: the operator log of heaved, the newest first.
import { t } from "./text.js";
import { button, element, table } from "./ui.js";

const SHOWN = 500;

// Lines of the log as rows, the newest first; only those with a word in them.
export function rowsOfLog(text, word) {
  const rows = text.split("\n").filter((line) => line !== "").map((line) => JSON.parse(line)).reverse();
  return rows.filter((row) => word === "" || JSON.stringify(row).toLowerCase().includes(word.toLowerCase()));
}

export async function build({ page, shown, place }) {
  const word = element("input", { type: "search", "aria-label": t("find"), placeholder: t("find"), id: "log-find" });
  const list = element("div", {});
  let text = "";
  const show = () => {
    const rows = rowsOfLog(text, word.value).slice(0, SHOWN);
    const who = (row) => row.by || `uid ${row.uid}`;
    list.replaceChildren(rows.length ? table([t("time"), t("who"), t("asked"), t("cameOf"), t("state")], rows.map((row) => [new Date(row.time).toLocaleString(document.documentElement.lang), who(row),
      row.request + (row.repeats_before ? ` (+${row.repeats_before})` : ""), row.ok ? t("done") : row.answer, row.before === row.after ? row.after : `${row.before} → ${row.after}`]), true) : element("p", {}, t("noIncidents")));
  };
  const load = async () => {
    const answer = await fetch(`api/log/${shown.platform}`);
    if (answer.ok) {
      text = await answer.text();
      show();
    } else {
      list.replaceChildren(element("p", { class: "bad" }, (await answer.json()).error));
    }
  };
  word.addEventListener("input", show);
  place.replaceChildren(element("section", {}, element("h2", {}, t("log")), element("div", { class: "buttons" }, word, button(t("again"), load),
    element("a", { class: "button", href: `api/log/${shown.platform}`, download: `${shown.platform}-operator.log` }, t("download"))), list));
  page.update = () => {};
  await load();
}
