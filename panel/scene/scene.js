// SPDX-License-Identifier: MIT
// scene.js - the platform in WebGL: joints, cylinders with their stroke, plate, motion reference point, where it is asked to be as a ghost, limits as colour and
// as words. Bundled with three.js by tools/lib/scene.sh; view.js loads it when somebody looks at it.
import { AmbientLight, BufferGeometry, CanvasTexture, Color, CylinderGeometry, DirectionalLight, DoubleSide, EdgesGeometry, ExtrudeGeometry, GridHelper, Group, Line, LineBasicMaterial, LineLoop, LineSegments, Mesh,
  MeshLambertMaterial, PerspectiveCamera, Scene as World, Shape, SphereGeometry, Sprite, SRGBColorSpace, SpriteMaterial, Vector3, WebGLRenderer } from "three";
import { extensionOf, nearness } from "./limits.js";
import { fromThree, plateMatrix, standpoint, toThree } from "./space.js";

const FIELD_DEG = 32;
const UP = new Vector3(0, 1, 0);
const vector = (point) => new Vector3(...toThree(point));

// A word that always faces the camera.
class Label {
  constructor(height) {
    this.canvas = document.createElement("canvas");
    Object.assign(this.canvas, { width: 192, height: 64 });
    this.texture = new CanvasTexture(this.canvas);
    this.texture.colorSpace = SRGBColorSpace;
    this.sprite = new Sprite(new SpriteMaterial({ map: this.texture, depthTest: false, transparent: true }));
    this.sprite.scale.set(height * 3, height, 1);
    this.sprite.renderOrder = 10;
  }

  write(text, ink, paper) {
    const now = `${text} ${ink} ${paper}`;
    if (this.now === now) return;
    this.now = now;
    const pen = this.canvas.getContext("2d");
    pen.clearRect(0, 0, 192, 64);
    Object.assign(pen, { font: "bold 38px system-ui, sans-serif", textAlign: "center", textBaseline: "middle" });
    const width = Math.min(188, pen.measureText(text).width + 20);
    Object.assign(pen, { fillStyle: paper, strokeStyle: ink, lineWidth: 3 });
    pen.beginPath();
    pen.rect(96 - width / 2, 6, width, 52);
    pen.fill();
    pen.stroke();
    pen.fillStyle = ink;
    pen.fillText(text, 96, 34, 180);
    this.texture.needsUpdate = true;
  }
}

export class Scene {
  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = new WebGLRenderer({ canvas, antialias: true, powerPreference: "low-power" });
    this.camera = new PerspectiveCamera(FIELD_DEG, 4 / 3, 10, 60000);
  }

  // Frees what the graphics card holds.
  end() {
    this.world?.traverse((one) => { one.geometry?.dispose(); one.material?.map?.dispose(); one.material?.dispose(); });
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  paint() {
    const style = getComputedStyle(document.body);
    const colour = (name) => style.getPropertyValue(`--${name}`).trim();
    this.colours = Object.fromEntries(["back", "front", "soft", "line", "act", "good", "close", "end"].map((name) => [name, colour(name)]));
  }

  build(geometry) {
    this.world?.traverse((one) => { one.geometry?.dispose(); one.material?.map?.dispose(); one.material?.dispose(); });
    this.geometry = geometry;
    this.paint();
    const { back, front, soft, line, act, good } = this.colours;
    const world = new World(), plain = (colour, more = {}) => new MeshLambertMaterial({ color: colour, ...more });
    world.background = new Color(back);
    const light = new DirectionalLight(0xffffff, 2.2);
    light.position.set(-0.6, 1, 0.8);
    world.add(new AmbientLight(0xffffff, 1.6), light);
    this.reach = Math.max(...[...geometry.base_mm, ...geometry.plate_mm].map((p) => Math.hypot(p[0], p[1])));
    this.thick = this.reach / 40;
    const size = 3 * this.reach;
    world.add(new GridHelper(size, 12, line, line), this.arrow(soft));
    const outline = (points, colour) => new LineLoop(new BufferGeometry().setFromPoints(points.map(vector)), new LineBasicMaterial({ color: colour }));
    world.add(outline(geometry.base_mm, soft));
    this.plate = new Group();
    this.plate.matrixAutoUpdate = false;
    this.ghost = new Group();
    this.ghost.matrixAutoUpdate = false;
    const local = geometry.plate_mm.map((p) => p.map((v, k) => v - geometry.mrp_mm[k]));
    this.plate.add(this.slab(local, plain(good, { transparent: true, opacity: 0.55, side: DoubleSide })), this.edges(local, good));
    this.ghost.add(this.edges(local, soft));
    const ball = new SphereGeometry(this.thick * 1.4, 16, 12);
    const joint = (parent, point) => { const made = new Mesh(ball, plain(front)); made.position.copy(vector(point)); parent.add(made); return made; };
    this.baseJoints = geometry.base_mm.map((point) => joint(world, point));
    this.plateJoints = local.map((point) => joint(this.plate, point));
    this.plate.add(this.cross(this.thick * 5, front));
    this.ghost.add(this.cross(this.thick * 5, soft));
    this.cylinders = geometry.base_mm.map(() => this.cylinder(world, plain(soft), plain(act), plain(line)));
    world.add(this.plate, this.ghost);
    this.world = world;
  }

  // Forward, on the floor.
  arrow(colour) {
    const r = this.reach, points = [[0, 0, 0], [1.45 * r, 0, 0], [1.35 * r, 0.05 * r, 0], [1.45 * r, 0, 0], [1.35 * r, -0.05 * r, 0]];
    const made = new Group(), label = new Label(r / 5);
    made.add(new Line(new BufferGeometry().setFromPoints(points.map(vector)), new LineBasicMaterial({ color: colour })), label.sprite);
    label.write("+X", this.colours.front, this.colours.back);
    label.sprite.position.copy(vector([1.6 * r, 0, 0]));
    return made;
  }

  // The motion reference point: three short lines through it.
  cross(size, colour) {
    const ends = [[size, 0, 0], [0, size, 0], [0, 0, size]];
    return new LineSegments(new BufferGeometry().setFromPoints(ends.flatMap((p) => [vector(p), vector(p.map((v) => -v))])), new LineBasicMaterial({ color: colour }));
  }

  slabGeometry(local) {
    const shape = new Shape();
    local.forEach((p, i) => { const [x, , z] = toThree(p); if (i) shape.lineTo(x, -z); else shape.moveTo(x, -z); });
    shape.closePath();
    const made = new ExtrudeGeometry(shape, { depth: this.thick, bevelEnabled: false }); // x and -z of three.js, grown along its own z
    made.rotateX(-Math.PI / 2);
    made.translate(0, toThree(local[0])[1], 0);
    return made;
  }

  slab(local, material) { return new Mesh(this.slabGeometry(local), material); }

  edges(local, colour) { return new LineSegments(new EdgesGeometry(this.slabGeometry(local)), new LineBasicMaterial({ color: colour })); }

  // Body as long as the cylinder retracted, the rod as far as it is out, and a thin rail to a stop: as far as it may go.
  cylinder(world, body, rod, rail) {
    const tube = (radius, material) => new Mesh(new CylinderGeometry(radius, radius, 1, 16).translate(0, 0.5, 0), material);
    const made = { body: tube(this.thick, body), rod: tube(this.thick * 0.55, rod), rail: tube(this.thick * 0.12, rail), stop: tube(this.thick * 0.8, rail), label: new Label(this.reach / 6) };
    world.add(made.body, made.rod, made.rail, made.stop, made.label.sprite);
    return made;
  }

  // Joints of the plate in the base frame of Heave, mm: as the scene has them.
  joints() {
    const at = new Vector3();
    return this.plateJoints.map((one) => fromThree(one.getWorldPosition(at).toArray()));
  }

  // What the cylinders of the scene are long beyond their bodies, mm.
  extensions() {
    const from = new Vector3(), to = new Vector3();
    return this.plateJoints.map((one, i) => one.getWorldPosition(to).distanceTo(this.baseJoints[i].getWorldPosition(from)) - this.geometry.retracted_length_mm[i]);
  }

  place(status) {
    const { geometry } = this;
    this.plate.matrix.set(...plateMatrix(geometry, status.pose_actual ?? status.pose_sent));
    this.ghost.visible = Boolean(status.pose_asked);
    if (status.pose_asked) this.ghost.matrix.set(...plateMatrix(geometry, status.pose_asked));
    this.world.updateMatrixWorld(true);
    const from = new Vector3(), to = new Vector3();
    this.cylinders.forEach((one, i) => {
      this.baseJoints[i].getWorldPosition(from);
      this.plateJoints[i].getWorldPosition(to);
      const along = to.clone().sub(from), length = along.length(), body = Math.min(geometry.retracted_length_mm[i], length), stroke = geometry.stroke_mm[i];
      along.normalize();
      const lay = (mesh, begin, span) => {
        mesh.position.copy(from).addScaledVector(along, begin);
        mesh.quaternion.setFromUnitVectors(UP, along);
        mesh.scale.set(1, Math.max(span, 0.01), 1);
      };
      lay(one.body, 0, body);
      lay(one.rod, body, length - body);
      lay(one.rail, body, stroke);
      lay(one.stop, body + stroke, this.thick * 0.3);
      const cylinder = status.cylinders[i], extension = extensionOf(cylinder), near = nearness(extension, cylinder.stroke_mm ?? stroke);
      one.rod.material.color.set(this.colours[near === "free" ? "act" : near]);
      one.body.material.color.set(this.colours[near === "end" ? "end" : "soft"]);
      one.label.sprite.position.copy(from).addScaledVector(along, body * 0.42);
      one.label.write(`${i + 1}: ${Math.round(extension)}${near === "free" ? "" : extension > stroke / 2 ? " ▲" : " ▼"}`, near === "end" ? this.colours.end : this.colours.front, this.colours.back);
    });
    this.world.updateMatrixWorld(true);
  }

  // width, tall in CSS pixels; azimuth and height of the look in degrees.
  draw(geometry, status, { width, tall, azimuth, height }) {
    const scheme = getComputedStyle(document.body).getPropertyValue("--back");
    if (geometry !== this.geometry || scheme !== this.scheme) this.build(geometry);
    this.scheme = scheme;
    this.place(status);
    const high = geometry.zero_height_mm, span = Math.max(1.25 * this.reach, high * 0.75) / Math.min(1, width / tall);
    const centre = [0, 0, high * 0.47];
    this.camera.aspect = width / tall;
    this.camera.updateProjectionMatrix();
    this.camera.position.set(...standpoint(azimuth, height, centre, span / Math.tan(FIELD_DEG / 2 * Math.PI / 180)));
    this.camera.lookAt(vector(centre));
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    if (this.sized !== `${width} ${tall} ${ratio}`) {
      this.renderer.setPixelRatio(ratio);
      this.renderer.setSize(width, tall, false);
      this.sized = `${width} ${tall} ${ratio}`;
    }
    this.renderer.render(this.world, this.camera);
  }
}
