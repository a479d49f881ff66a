// SPDX-License-Identifier: MIT
// recorder.js - every cycle from a press of a button to the next, as the file that `heavectl scope` writes. In the page's memory; goes on on other pages.
import { refusalOf } from "./text.js";

const MAX_S = 600;
const AXES = ["roll_deg", "pitch_deg", "yaw_deg", "x_mm", "y_mm", "z_mm"];

export class Recorder {
  constructor(link, takers) {
    Object.assign(this, { link, takers, stream: 0, rows: 0, lost: 0, blocks: [] });
  }

  get isOn() { return this.stream !== 0; }

  get seconds() { return this.rows * this.cycleUs / 1e6; }

  async begin(platform, cylinders) {
    const legs = (what) => Array.from({ length: cylinders }, (_, i) => `${what}_c${i + 1}_mm`);
    const columns = ["cycle", "t_ms", "state", "fault", "relays", "bits", "flags", "frame_age_ms", ...AXES.map((axis) => `sent_${axis}`), ...AXES.map((axis) => `actual_${axis}`), ...legs("sent"), ...legs("actual")];
    const got = await this.link.ask({ op: "samples", platform, columns, every: 1, history_s: 0 });
    if (got.error) return refusalOf(got);
    Object.assign(this, { platform, stream: got.stream, names: columns, cycleUs: got.cycle_us, rows: 0, lost: 0, blocks: [], at: new Date() });
    this.takers[got.stream] = this;
    return null;
  }

  take(block) {
    if (this.seconds >= MAX_S) return this.stop();
    this.blocks.push(block.columns.map((column) => column.slice()));
    this.rows += block.rows;
    this.lost += block.lost;
    return undefined;
  }

  stop() {
    if (!this.isOn) return;
    this.link.send({ op: "samples-end", platform: this.platform, stream: this.stream, id: 0 });
    delete this.takers[this.stream];
    this.stream = 0;
  }

  // The parts of the file.
  text() {
    const parts = [`${this.names.join(",")}\n`];
    for (const columns of this.blocks) {
      let text = "";
      for (let row = 0; row < columns[0].length; row++) text += `${columns.map((column) => +column[row].toFixed(6)).join(",")}\n`;
      parts.push(text);
    }
    return parts;
  }

  save() {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob(this.text(), { type: "text/csv" }));
    link.download = `${this.platform}-${this.at.toISOString().replace(/[-:]|\.\d+/g, "")}.csv`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60000);
  }
}
