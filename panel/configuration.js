// SPDX-License-Identifier: MIT
// configuration.js - the configuration of a platform as text and as sizes: what each key means, what heaved says of it at its line, what would change, and
// bringing it into force by heaved's own rules.
import { difference, Draft, entriesOf, withValue } from "./draft.js";
import { buildSizes } from "./sizes.js";
import { store } from "./store.js";
import { chinese, putBackOf, refusalOf, t } from "./text.js";
import { button, element, fill, rowsOf } from "./ui.js";

const LINE_PX = 24;
let keys = {}; // by language: the table never changes while heaved is the same

async function keyTable() {
  const language = chinese() ? "zh" : "en";
  if (!keys[language]) {
    const answer = await fetch(chinese() ? "api/keys/zh" : "api/keys");
    const got = await answer.json();
    if (!answer.ok) throw new Error(got.error);
    keys[language] = got.sections;
  }
  return keys[language];
}

export async function build({ page, shown, say, place, link, take }) {
  const draft = new Draft(shown.platform);
  page.end = () => { isHere = false; draft.end(); };
  let isHere = true, sections = [];
  try {
    [sections] = await Promise.all([keyTable(), draft.load()]);
  } catch (error) {
    place.replaceChildren(element("section", {}, element("p", { class: "bad" }, String(error.message))));
    return;
  }
  if (!isHere) return;
  const notices = element("div", { id: "config-notices", role: "status", "aria-live": "polite" }), body = element("div", {}), controls = element("div", {});
  let view = "text", shownView = null;
  const views = { text: () => buildText({ draft, sections }), sizes: () => buildSizes({ draft, sections }), changes: () => buildChanges({ draft, sections, apply, shown }) };
  const tabs = element("div", { class: "buttons", role: "tablist" });

  const show = (name) => {
    view = name;
    shownView?.end?.();
    shownView = views[view]();
    body.replaceChildren(shownView.part);
    refresh();
  };

  function refresh() {
    const other = shown.status && shown.status.configuration.digest !== draft.base.digest;
    const isStale = draft.isChanged && draft.wasMadeFrom !== draft.base.digest;
    const wrong = draft.found && !draft.found.ok ? draft.found.errors.length : 0;
    const putBack = putBackOf(shown.status);
    fill(notices, putBack ? element("p", { class: "notice bad", id: "config-put-back" }, `${t("putBack")} ${putBack}`) : null,
      draft.isRestored && draft.isChanged ? element("p", { class: "notice" }, t("draftRestored")) : null,
      other || isStale ? element("p", { class: "notice bad" }, t("draftStale"), " ", button(t("draftRebase"), null, { "data-act": "rebase" })) : null,
      draft.base.keeps ? null : element("p", { class: "notice bad" }, t("draftNowhere")),
      draft.error ? element("p", { class: "notice bad" }, draft.error) : null,
      element("p", { id: "config-verdict", class: wrong ? "bad" : draft.staged ? "good" : "soft" }, draft.error ? "" : !draft.staged ? t("checking") : wrong ? `${t("mistakes")}: ${wrong}` : draft.isChanged ? t("configRight") : t("configSame")));
    fill(tabs, ...Object.keys(views).map((name) => button(t(`config_${name}`), null, { role: "tab", "data-view": name, "aria-selected": String(name === view) })));
    fill(controls, element("p", {}, shown.isMine ? t("yours") : t("takeFirst")), element("div", { class: "buttons" }, button(shown.isMine ? t("drop") : t("take"), null, { "data-act": shown.isMine ? "drop" : "take" }),
      button(t("draftRevert"), null, { "data-act": "revert", disabled: !draft.isChanged }), element("a", { class: "button", download: `${shown.platform}.ini`, href: "#", "data-act": "save" }, t("download"))));
    shownView?.refresh();
  }

  async function apply() {
    const got = await link.ask({ op: "configure", platform: shown.platform, base: draft.base.digest, staged: draft.staged, tick: shown.status?.tick });
    const error = refusalOf(got);
    if (error) { say(error); return error; }
    if (got.answer.restart) draft.handedOver();
    else store.remove(draft.name);
    say(got.answer.restart ? t("appliedRestart") : t("applied"));
    draft.base = { ...draft.base, text: draft.text, digest: got.answer.digest, applied: true };
    draft.wasMadeFrom = got.answer.digest;
    draft.isRestored = false;
    if (!got.answer.restart) show("text");
    return null;
  }

  const acts = {
    take: () => take("take"), drop: () => take("drop"),
    revert: () => { draft.revert(); show(view); },
    rebase: async () => { await draft.rebase(); show("changes"); },
    save: (event) => { event.target.href = URL.createObjectURL(new Blob([draft.text], { type: "text/plain" })); },
  };
  place.replaceChildren(element("div", { class: "grid" }, element("section", {}, element("h2", {}, t("configuration")), rowsOf([[t("configFile"), draft.base.file], [t("configForce"), t(draft.base.applied ? "configApplied" : "configOwn")]]), notices, tabs), body,
    element("section", {}, element("h2", {}, t("controls")), controls)));
  place.onclick = (event) => {
    const act = event.target.dataset?.act, to = event.target.dataset?.view;
    if (act) acts[act](event);
    if (to) show(to);
  };
  const end = page.end;
  page.end = () => { end(); shownView?.end?.(); place.onclick = null; };
  let known = "";
  page.update = () => { // ten times a second: only what has changed is built anew
    const now = `${shown.isMine} ${shown.holder} ${shown.status?.configuration.digest} ${putBackOf(shown.status)}`;
    if (now !== known) { known = now; refresh(); }
  };
  draft.listeners.add(refresh);
  show("text");
}

// --- As text ---

function buildText({ draft, sections }) {
  const marks = element("pre", { class: "marks", "aria-hidden": "true" });
  const numbers = element("pre", { class: "numbers", "aria-hidden": "true" });
  const area = element("textarea", { id: "config-text", wrap: "off", spellcheck: "false", autocapitalize: "off", autocomplete: "off", "aria-label": t("config_text"), "aria-describedby": "config-mistakes" });
  const help = element("div", { id: "config-help", "aria-live": "polite" }), mistakes = element("div", { id: "config-mistakes" }), report = element("pre", { class: "report", tabindex: "0", "aria-label": t("configReport") });
  const word = element("input", { type: "search", id: "config-find", placeholder: t("findKey"), "aria-label": t("findKey") }), found = element("div", { id: "config-found" });
  area.value = draft.text;

  const follow = () => { marks.style.transform = `translate(${-area.scrollLeft}px, ${-area.scrollTop}px)`; numbers.style.transform = `translateY(${-area.scrollTop}px)`; };
  const lineNow = () => area.value.slice(0, area.selectionStart).split("\n").length;
  const goTo = (line) => {
    const lines = area.value.split("\n"), start = lines.slice(0, line - 1).join("\n").length + (line > 1 ? 1 : 0);
    area.focus({ preventScroll: true });
    area.scrollIntoView({ block: "nearest" });
    area.setSelectionRange(start, start + (lines[line - 1] ?? "").length);
    area.scrollTop = Math.max(0, (line - 4) * LINE_PX);
    area.scrollLeft = 0;
    follow();
    showHelp();
  };

  function showHelp() {
    const line = lineNow();
    let name = "";
    area.value.split("\n").slice(0, line).forEach((one) => { name = /^\[([^\]]+)\]/.exec(one)?.[1] ?? name; });
    const section = sections.find((one) => one.name === name);
    const key = section?.keys.find((one) => one.name === /^([A-Za-z0-9_:]+)/.exec(area.value.split("\n")[line - 1])?.[1]);
    const wrong = draft.found?.ok === false && draft.staged ? draft.found.errors.filter((one) => one.line === line) : [];
    fill(help, ...wrong.map((one) => element("p", { class: "bad" }, `${t("line")} ${line}: ${one.text}`)), section ? element("p", {}, element("b", {}, `[${section.name}] `), section.help) : element("p", { class: "soft" }, t("configHint")),
      section?.list && !key ? element("p", { class: "soft" }, section.list) : null, key ? keyHelp(key) : null);
  }

  let last = [];
  function showMistakes() {
    const now = [area.value, draft.found, draft.staged];
    if (now.every((one, i) => one === last[i])) return;
    last = now;
    const errors = draft.staged && draft.found && !draft.found.ok ? draft.found.errors : [];
    const at = new Map();
    for (const one of errors) at.set(one.line, [...(at.get(one.line) ?? []), one.text]);
    const lines = area.value.split("\n");
    numbers.replaceChildren(...lines.map((_, i) => element("span", { class: at.has(i + 1) ? "wrong" : "" }, `${at.has(i + 1) ? "✖ " : ""}${i + 1}\n`)));
    marks.replaceChildren(...lines.map((line, i) => element("span", { class: at.has(i + 1) ? "wrong" : "" }, line, at.has(i + 1) ? element("span", { class: "beside" }, `  ◀ ${at.get(i + 1).join("; ")}`) : "", "\n")));
    fill(mistakes, ...errors.map((one) => button(`${one.line ? `${t("line")} ${one.line}: ` : ""}${one.text}`, null, { class: "mistake", "data-line": one.line })));
    report.textContent = draft.found?.report ?? "";
    follow();
  }

  function showFound() {
    const wanted = word.value.trim().toLowerCase();
    const all = wanted === "" ? [] : sections.flatMap((section) => section.keys.map((key) => ({ section, key }))).filter(({ section, key }) => `${section.name} ${key.name} ${key.help}`.toLowerCase().includes(wanted)).slice(0, 12);
    const here = entriesOf(area.value);
    fill(found, ...all.map(({ section, key }) => {
      const at = here.find((one) => one.section === section.name && one.key === key.name);
      return element("div", { class: "key" }, element("p", {}, element("b", {}, `[${section.name}] ${key.name}`)), keyHelp(key), button(at ? `${t("goToLine")} ${at.line}` : t("addKey"), null, at ? { "data-line": at.line } : { "data-section": section.name, "data-key": key.name }));
    }));
  }

  area.addEventListener("input", () => draft.set(area.value));
  area.addEventListener("scroll", follow);
  for (const name of ["keyup", "click", "focus"]) area.addEventListener(name, showHelp);
  word.addEventListener("input", showFound);
  const part = element("div", { class: "grid" }, element("div", { class: "grid wide" },
    element("section", {}, element("div", { class: "editor" }, element("div", { class: "gutter" }, numbers), element("div", { class: "sheet" }, marks, area)), mistakes),
    element("div", { class: "grid" }, element("section", {}, element("h2", {}, t("keyHelp")), help), element("section", {}, element("h2", {}, t("findKey")), word, found))),
  element("section", {}, element("details", {}, element("summary", {}, t("configReport")), report)));
  part.addEventListener("click", (event) => {
    const data = event.target.dataset ?? {};
    if (data.line && Number(data.line) > 0) goTo(Number(data.line));
    if (data.key) {
      const key = sections.find((one) => one.name === data.section).keys.find((one) => one.name === data.key);
      area.value = withValue(area.value, data.section, data.key, key.default ?? "");
      draft.set(area.value);
      goTo(entriesOf(area.value).find((one) => one.section === data.section && one.key === data.key)?.line ?? 1);
      showFound();
    }
  });
  showHelp();
  return { part, refresh() { if (area.value !== draft.text) area.value = draft.text; showMistakes(); showHelp(); } };
}

const keyHelp = (key) => element("div", {}, element("p", {}, key.help), rowsOf([[t("keyAllowed"), key.allowed], [t("keyDefault"), key.default ?? t("keyRequired")], [t("keyUnit"), key.unit || "–"], [t("keyChanges"), t(key.live ? "keyLive" : "keyRestart")]]));

// --- What would change ---

function changedKeys(before, after, sections) {
  const map = (text) => new Map(entriesOf(text).map((one) => [`${one.section}\n${one.key}`, one.value]));
  const a = map(before), b = map(after), names = [...new Set([...a.keys(), ...b.keys()])].filter((name) => a.get(name) !== b.get(name));
  return names.map((name) => {
    const [section, key] = name.split("\n");
    const known = sections.find((one) => one.name === section)?.keys.find((one) => one.name === key);
    return { section, key, was: a.get(name) ?? known?.default ?? "–", is: b.get(name) ?? known?.default ?? "–", live: known?.live ?? false };
  });
}

function buildChanges({ draft, sections, apply, shown }) {
  const list = element("div", { id: "config-changes" }), lines = element("div", { class: "diff scroll", tabindex: "0", "aria-label": t("config_changes") }), answer = element("p", { class: "bad", id: "config-refused", role: "alert" });
  const go = button(t("applyNow"), async () => { go.disabled = true; answer.textContent = (await apply()) ?? ""; refresh(); }, { class: "main", id: "config-apply" });
  const note = element("p", { class: "notice" });

  function refresh() {
    const changed = changedKeys(draft.base.text, draft.text, sections);
    const rows = difference(draft.base.text, draft.text);
    const near = rows.map((_, i) => rows.slice(Math.max(0, i - 2), i + 3).some(([sign]) => sign !== " "));
    const needsRestart = changed.some((one) => !one.live);
    fill(list, ...changed.map((one) => element("p", {}, element("b", {}, `[${one.section}] ${one.key}`), `: ${one.was} → ${one.is} `, element("span", { class: one.live ? "good" : "warn" }, t(one.live ? "keyLive" : "keyRestart")))), changed.length ? null : element("p", {}, t(draft.isChanged ? "configWords" : "configSame")));
    fill(lines, ...rows.flatMap(([sign, line], i) => (near[i] ? [element("div", { class: sign === "+" ? "added" : sign === "-" ? "removed" : "" }, `${sign} ${line}`)] : near[i - 1] ? [element("div", { class: "soft" }, "…")] : [])));
    note.textContent = `${needsRestart ? t("applyRestart") : t("applyLive")} ${shown.isMine ? "" : t("takeFirst")}`;
    go.disabled = !draft.isChanged || !draft.staged || !draft.found?.ok || !draft.base.keeps || !shown.isMine || draft.wasMadeFrom !== draft.base.digest || shown.status?.configuration.digest !== draft.base.digest;
  }
  return { part: element("section", {}, element("h2", {}, t("config_changes")), list, lines, element("p", {}, t("applyKept")), note, element("div", { class: "buttons" }, go), answer), refresh };
}
