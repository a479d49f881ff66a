// SPDX-License-Identifier: MIT
// hand.js - a button that moves the machine as long as it is held: a press, beats of 50 ms from the main thread with the newest tick that
// this page has heard, a release. Whatever ends the hold (finger, window, tab, connection) ends the beats; heaved stops 250 ms later by itself.
import { refusalOf } from "./text.js";

const BEAT_MS = 50;
const REST_MS = 150; // a finger that rests so long wants to move the machine; one that swipes wants to see more of the page
let held = 0;

// Whether a button that moves the machine is held, on any page of this tab: what can wait waits then.
export const isHolding = () => held > 0;

export class Hand {
  constructor(link, platform, say) {
    Object.assign(this, { link, platform, say, tick: 0, series: 0, counter: 0, timer: null, isPressing: false });
    this.letGo = this.letGo.bind(this);
    window.addEventListener("blur", this.letGo);
    window.addEventListener("pagehide", this.letGo);
    document.addEventListener("visibilitychange", this.letGo);
  }

  end() {
    this.letGo();
    window.removeEventListener("blur", this.letGo);
    window.removeEventListener("pagehide", this.letGo);
    document.removeEventListener("visibilitychange", this.letGo);
  }

  heard(tick) {
    this.tick = tick.tick;
    if (this.series && !(tick.held && tick.series === this.series)) this.letGo(); // heaved has ended it
  }

  async press(line) {
    if (this.isPressing || this.timer) return;
    this.isPressing = true;
    this.isWanted = true;
    const message = typeof line === "string" ? { op: "press", line } : line; // what is more than a request of heaved has an operation of its own
    const got = await this.link.ask({ ...message, platform: this.platform, tick: this.tick });
    this.isPressing = false;
    if (got.error || got.answer?.ok === false) {
      this.say(refusalOf(got));
      this.isWanted = false;
      return;
    }
    this.series = got.answer.series;
    this.tick = got.answer.tick;
    this.counter = 0;
    if (!this.isWanted) return this.letGo();
    held += 1;
    this.timer = setInterval(() => {
      this.counter += 1;
      this.link.send({ op: "beat", platform: this.platform, series: this.series, counter: this.counter, tick: this.tick });
    }, BEAT_MS);
  }

  letGo() {
    this.isWanted = false;
    if (this.timer !== null) held -= 1;
    clearInterval(this.timer);
    this.timer = null;
    if (this.series) this.link.send({ op: "release", platform: this.platform });
    this.series = 0;
    this.onLetGo?.();
  }

  // Makes a button one that is held. line(): what to press. A finger that leaves the button lets go, and so does a page that scrolls below it.
  attach(button, line) {
    let rest = null;
    const isHeld = () => button.classList.contains("held");
    const begin = () => {
      button.classList.add("held");
      this.onLetGo = () => button.classList.remove("held");
      this.press(line());
    };
    const end = () => {
      clearTimeout(rest);
      if (isHeld()) this.letGo();
    };
    button.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      event.preventDefault();
      button.setPointerCapture(event.pointerId);
      if (event.pointerType === "mouse") begin();
      else rest = setTimeout(begin, REST_MS);
    });
    button.addEventListener("pointermove", (event) => {
      const box = button.getBoundingClientRect();
      if (event.clientX < box.left || event.clientX > box.right || event.clientY < box.top || event.clientY > box.bottom) end();
    });
    button.addEventListener("touchmove", (event) => { if (isHeld()) event.preventDefault(); }, { passive: false }); // no scrolling in the middle of a motion
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) button.addEventListener(name, end);
    button.addEventListener("keydown", (event) => { if ((event.key === " " || event.key === "Enter") && !event.repeat) { event.preventDefault(); begin(); } });
    button.addEventListener("keyup", end);
    button.addEventListener("blur", end);
    button.addEventListener("contextmenu", (event) => event.preventDefault());
  }
}
