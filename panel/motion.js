// SPDX-License-Identifier: MIT
// motion.js - what a picture follows: pose and cylinders of the samples, some 60 times a second; where heaved keeps none, the statuses do.
const EVERY_US = 16000;
const AXES = ["roll_deg", "pitch_deg", "yaw_deg", "x_mm", "y_mm", "z_mm"];
const POSE_KNOWN = 4; // of `bits`

export class Motion {
  constructor({ link, takers, platform, view }) {
    Object.assign(this, { link, takers, platform, view, stream: 0, isOver: false });
  }

  async begin(geometry, status) {
    this.geometry = geometry;
    this.status = status;
    const legs = status.cylinders.map((_, i) => `actual_c${i + 1}_mm`);
    this.names = ["bits", ...["asked", "sent", "actual"].flatMap((what) => AXES.map((axis) => `${what}_${axis}`)), ...legs];
    const got = await this.link.ask({ op: "samples", platform: this.platform, columns: this.names, every: Math.max(1, Math.round(EVERY_US / status.cycle_us)), history_s: 0 });
    if (got.error) return;
    this.stream = got.stream;
    if (this.isOver) return this.end();
    this.takers[got.stream] = this;
  }

  // The newest two rows of a block are the least and the most of one moment: between them is where it was.
  take(block) {
    if (block.rows < 2 || !this.status) return;
    const value = block.columns.map((column) => (column[block.rows - 1] + column[block.rows - 2]) / 2);
    const at = (name) => value[this.names.indexOf(name)];
    const pose = (what) => Object.fromEntries(AXES.map((axis) => [axis, at(`${what}_${axis}`)]));
    const isKnown = (block.columns[0][block.rows - 1] & POSE_KNOWN) !== 0;
    this.isFed = true;
    this.view.draw(this.geometry, { ...this.status, pose_asked: this.status.pose_asked && pose("asked"), pose_sent: pose("sent"), pose_actual: isKnown ? pose("actual") : null,
      cylinders: this.status.cylinders.map((one, i) => ({ ...one, actual_mm: one.actual_mm === null ? null : at(`actual_c${i + 1}_mm`) })) });
  }

  // A status: what samples do not tell, and all of it where there are none.
  heard(status) {
    this.status = status;
    if (!this.isFed) this.view.draw(this.geometry, status);
  }

  end() {
    this.isOver = true;
    if (!this.stream) return;
    this.link.send({ op: "samples-end", platform: this.platform, stream: this.stream, id: 0 });
    delete this.takers[this.stream];
    this.stream = 0;
  }
}
