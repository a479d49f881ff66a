// SPDX-License-Identifier: MIT
// drives.js - buses and drives with what they say: `cylinders[]`, `rotation` and `bus` of the status (docs/status-json.md).
import { t } from "./text.js";
import { element, number, rowsOf, table } from "./ui.js";

const hex = (value) => `0x${value.toString(16).toUpperCase().padStart(4, "0")}`;

// What a drive has to say beside its state: sentences, the worst first; [text, class].
export function wordsOf(drive) {
  const report = drive.report, out = [];
  if (drive.device_code) out.push([`${t("driveCode")} ${hex(drive.device_code)}`, "bad"]);
  if (!report) return out;
  if (report.trouble) out.push([[report.trouble, report.detail, report.object ? `${hex(report.object)}:${report.sub_index}` : "", report.wanted === null || report.wanted === undefined ? "" : `${report.found} / ${report.wanted}`].filter(Boolean).join("; "), "warn"]);
  const emergency = report.emergency;
  if (emergency) out.push([`EMCY ${hex(emergency.code)} ${emergency.text}${emergency.over ? ` (${t("isOver")})` : ""} × ${emergency.count}`, emergency.over ? "" : "bad"]);
  for (const note of report.notes ?? []) out.push([note, "warn"]);
  return out;
}

const away = (drive) => { const [sent, actual] = [drive.sent_mm ?? drive.sent_deg, drive.actual_mm ?? drive.actual_deg]; return actual === null || actual === undefined ? null : sent - actual; };

// Its state; a drive that is off or has failed may still have torque while it stops.
export function stateOf(drive) {
  const state = t(drive.drive === "fault" ? "faulted" : drive.drive);
  if (!drive.torque || (drive.drive !== "disabled" && drive.drive !== "fault")) return state;
  return drive.drive === "fault" ? `${state}, ${t("stillTorque")}` : t("stillTorque");
}

// The table of a status, and what drives say below it.
export function drivesOf(status) {
  const all = [...status.cylinders.map((one) => ({ ...one, name: String(one.number) })), ...(status.rotation ? [{ ...status.rotation, name: t("rotation") }] : [])];
  const hasTorque = all.some((one) => one.report?.telemetry), hasAge = all.some((one) => one.feedback_age_ms !== null && one.feedback_age_ms !== undefined);
  const head = [t("drive"), t("state"), t("homed"), t("sent"), t("actual"), t("following"), ...(hasAge ? [t("feedbackAge")] : []), ...(hasTorque ? [t("torque")] : [])];
  const rows = all.map((one) => [one.name, stateOf(one), t(one.homed ? "yes" : "no"), number(one.sent_mm ?? one.sent_deg), number(one.actual_mm ?? one.actual_deg), number(away(one), 3),
    ...(hasAge ? [number(one.feedback_age_ms, 1)] : []), ...(hasTorque ? [one.report?.telemetry ? `${number(one.report.telemetry.torque_percent, 0)} %` : "–"] : [])]);
  const said = all.flatMap((one) => wordsOf(one).map(([text, className]) => element("p", { class: `notice ${className}` }, `${t("drive")} ${one.name}: ${text}`)));
  const phases = all.filter((one) => one.report).map((one) => [`${t("drive")} ${one.name}`, `${one.report.node ? `${t("node")} ${one.report.node}: ` : ""}${one.report.phase}`]);
  return [table(head, rows), ...said, said.length ? null : element("p", { class: "good" }, t("noneComplains")), phases.length ? rowsOf(phases) : null];
}

export function busOf(status) {
  const { bus } = status;
  return rowsOf([[t("bus"), bus ? bus.trouble || t("fine") : t("simulated")], ...(bus?.last_trouble ? [[t("lastTrouble"), bus.last_trouble]] : []),
    [t("relays"), `${status.relays.on.join(", ") || t("none")}${status.relays.known ? "" : ` (${t("unknown")})`}`]]);
}
