// SPDX-License-Identifier: MIT
// view.js - the platform, to be looked at from any side: in WebGL, loaded when somebody looks at it; flat where there is none, where the file is missing, and until it has come.
import { isHolding } from "./hand.js";
import { Picture } from "./picture.js";
import { t } from "./text.js";
import { button, element } from "./ui.js";

const PAUSE_MS = 33, PAUSE_SLOW_MS = 250, PAUSE_HELD_MS = 500; // between two images; slow: without a graphics card; while a button is held, what draws them must not keep its beats waiting
const TURN_DEG = 0.4; // for each pixel

const SOFTWARE = /swiftshader|llvmpipe|software|basic render/i;

// "none"; "software": no graphics card draws but the processor, which has the beats of held buttons to send; "yes". Asked once: a context costs memory.
let webgl, isWanted = false; // isWanted: in 3D although the processor has to draw it
function kindOfWebGL() {
  if (webgl === undefined) {
    const context = document.createElement("canvas").getContext("webgl2"), told = context?.getExtension("WEBGL_debug_renderer_info");
    webgl = context === null ? "none" : told && SOFTWARE.test(context.getParameter(told.UNMASKED_RENDERER_WEBGL)) ? "software" : "yes";
    context?.getExtension("WEBGL_lose_context")?.loseContext();
  }
  return webgl;
}

// Whether the panel was built with the file that draws in 3D; only asked, not loaded.
const hasScene = () => fetch("scene.js").then((answer) => { answer.body?.cancel(); return answer.ok; }, () => false);

export class View {
  // place: an element that gets the picture.
  constructor(place, { tallest = 460 } = {}) {
    Object.assign(this, { place, tallest, azimuth: 28, height: 18, drawn: 0, timer: null, isOver: false });
    this.note = element("p", { class: "soft", hidden: true });
    place.replaceChildren(this.note);
    place.view = this; // for tests
    this.put(Picture);
    this.seen = new IntersectionObserver((entries) => { if (entries.some((one) => one.isIntersecting)) this.load(); });
    this.seen.observe(this.canvas);
  }

  // Puts a canvas there with what draws on it: one that has been drawn on flat has no WebGL any more.
  put(Kind) {
    const canvas = element("canvas", { tabindex: "0", role: "img", "aria-label": this.label ?? t("picture") });
    const drawer = new Kind(canvas);
    this.drawer?.end?.();
    this.canvas?.remove();
    Object.assign(this, { canvas, drawer });
    this.place.prepend(canvas);
    canvas.addEventListener("pointerdown", (event) => { this.last = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { this.last = null; });
    canvas.addEventListener("pointermove", (event) => {
      if (!this.last) return;
      this.turnBy((event.clientX - this.last[0]) * TURN_DEG, (event.clientY - this.last[1]) * TURN_DEG);
      this.last = [event.clientX, event.clientY];
    });
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-8, 0], ArrowRight: [8, 0], ArrowUp: [0, -8], ArrowDown: [0, 8] }[event.key];
      if (step) { this.turnBy(...step); event.preventDefault(); }
    });
    canvas.addEventListener("webglcontextlost", () => { if (!this.isOver) this.flat(t("noWebGL")); });
  }

  async load() {
    this.seen.disconnect();
    if (kindOfWebGL() === "none") return this.flat(t("noWebGL"));
    if (kindOfWebGL() === "software" && !isWanted && !(await hasScene())) return this.flat(t("noScene")); // no button that leads nowhere
    if (kindOfWebGL() === "software" && !isWanted) return this.flat(t("slowWebGL"), button(t("allTheSame"), () => { isWanted = true; this.note.replaceChildren(); this.note.hidden = true; this.load(); }, { class: "in-3d" }));
    try {
      const { Scene } = await import("./scene.js");
      if (!this.isOver) this.put(Scene);
    } catch (error) {
      return this.flat(t("noScene"));
    }
    return this.paint();
  }

  flat(why, ...more) {
    this.note.replaceChildren(`${why} `, ...more);
    this.note.hidden = false;
    if (!(this.drawer instanceof Picture)) this.put(Picture);
    this.paint();
  }

  turnBy(dx, dy) {
    this.azimuth += dx;
    this.height = Math.min(89, Math.max(-10, this.height + dy));
    this.later();
  }

  // geometry: of the request of that name. status: pose_sent, pose_asked, pose_actual, cylinders, as in the status.
  draw(geometry, status) {
    Object.assign(this, { geometry, status });
    this.later();
  }

  later() {
    if (this.timer !== null) return;
    this.timer = setTimeout(() => { this.timer = null; this.paint(); }, Math.max(0, this.drawn + (isHolding() ? PAUSE_HELD_MS : isWanted ? PAUSE_SLOW_MS : PAUSE_MS) - performance.now()));
  }

  paint() {
    const width = this.canvas.clientWidth;
    if (this.isOver || !this.geometry || !this.status || width === 0 || document.hidden) return;
    const tall = Math.round(Math.min(width * 0.8, this.tallest));
    this.canvas.style.height = `${tall}px`;
    this.drawer.draw(this.geometry, this.status, { width, tall, azimuth: this.azimuth, height: this.height });
    this.drawn = performance.now();
  }

  // What it shows, for those who do not see it.
  tell(text) {
    this.label = text;
    if (this.canvas.getAttribute("aria-label") !== text) this.canvas.setAttribute("aria-label", text);
  }

  end() {
    this.isOver = true;
    this.seen.disconnect();
    clearTimeout(this.timer);
    this.drawer.end?.();
  }
}
