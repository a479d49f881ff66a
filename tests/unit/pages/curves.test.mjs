// SPDX-License-Identifier: MIT
import assert from "node:assert/strict";
import test from "node:test";
const { Curves, Store, ends, spectrum, strongest, ticks } = await import("/curves.js");

const canvas = () => ({ clientWidth: 462, addEventListener() {}, style: {} }); // 400 of it are curves
const COLUMNS = [{ name: "t_ms", unit: "ms" }, { name: "x", unit: "mm" }];
const block = (from, rows, value) => ({ lost: 0, rows, columns: [Float64Array.from({ length: rows }, (_, i) => from + i), Float64Array.from({ length: rows }, (_, i) => value(from + i))] });

function filled(rows, value) {
  const curves = new Curves(canvas());
  curves.begin(COLUMNS, 1000);
  for (let from = 0; from < rows; from += 100) curves.take(block(from, 100, value));
  return curves;
}

test("the last half minute is kept, every cycle of it, the oldest first", () => {
  const { store } = filled(40000, (t) => t);
  assert.equal(store.length, 30001);
  assert.equal(store.value(0, 0), 9999);
  assert.equal(store.value(1, store.length - 1), 39999);
  assert.equal(store.find(10000.5), 2);
  assert.deepEqual(store.tail(1, 3), [39997, 39998, 39999]);
});

test("no peak of one cycle is lost, whatever the zoom", () => {
  const curves = filled(30000, (t) => (t === 12345 ? 99 : t === 20001 ? -50 : Math.sin(t / 100)));
  for (const places of [10, 390, 1500]) {
    const seen = curves.store.envelope(1, 0, 30000, places).filter((one) => one !== null);
    assert.equal(Math.max(...seen.map((one) => one[1])), 99);
    assert.equal(Math.min(...seen.map((one) => one[0])), -50);
  }
  const close = curves.store.envelope(1, 12340, 12350, 100).filter((one) => one !== null);
  assert.equal(close.length, 10);
  assert.equal(close[5][1], 99);
});

test("what stands for no frame yet is no value", () => {
  const store = new Store(COLUMNS, 1000);
  [5, 4294967.295, 7].forEach((value, i) => store.add([[i], [value]], 0));
  assert.deepEqual(ends([store.envelope(1, 0, 3, 3)]).map((value) => Math.round(value)), [5, 7]);
});

test("a zoom keeps the moment under the finger, and stays within what there is", () => {
  const curves = filled(30000, (t) => t);
  curves.zoom(0.1);
  assert.equal(curves.spanS, 1);
  assert.equal(curves.end, 29999);
  curves.pause(true);
  curves.pan(-9999);
  assert.equal(curves.end, 20000);
  const before = curves.timeAt(62 + 100);
  curves.zoom(0.5, before);
  assert.ok(Math.abs(curves.timeAt(62 + 100) - before) < 1e-6);
  curves.zoom(1e-9);
  assert.equal(curves.spanS, 0.02);
  curves.zoom(1e9);
  assert.equal(curves.spanS, 30);
  assert.equal(curves.end, 29999);
  curves.pan(1e9);
  assert.equal(curves.end, 29999);
});

test("what is paused stands still, and marks measure in it", () => {
  const curves = filled(2000, (t) => 2 * t);
  curves.mark(100);
  assert.deepEqual(curves.marks, []);
  curves.pause(true);
  curves.take(block(2000, 100, () => 0));
  assert.equal(curves.newest, 1999);
  curves.mark(1300);
  curves.mark(1000);
  assert.deepEqual(curves.between(), { ms: 300, hz: 1000 / 300, values: [600] });
  curves.mark(5);
  assert.deepEqual(curves.marks, [5]);
});

test("a trigger stands still half a screen after the level", () => {
  const curves = new Curves(canvas());
  curves.spanS = 1;
  curves.begin(COLUMNS, 1000);
  curves.arm(0.5);
  for (let from = 0; from < 4000; from += 100) curves.take(block(from, 100, (t) => (t >= 1234 ? 1 : 0)));
  assert.deepEqual([curves.isPaused, curves.isArmed, curves.metAt, curves.newest], [true, false, 1234, 1734]);
});

test("rows that were lost are counted", () => {
  const curves = filled(100, () => 0);
  curves.take({ ...block(150, 10, () => 0), lost: 50 });
  assert.equal(curves.lost, 50);
});

test("a ripple is named within 0.5 Hz, beside a stronger slow motion and noise", () => {
  let seed = 1;
  const noise = () => { seed = (seed * 1103515245 + 12345) % 2147483648; return seed / 2147483648 - 0.5; };
  for (const hz of [5.3, 37, 61.8, 183]) {
    const values = Array.from({ length: 4096 }, (_, i) => 20 * i / 4096 + 0.05 * Math.sin(2 * Math.PI * hz * i / 1000) + 0.01 * noise());
    const [found, amplitude] = strongest(spectrum(values, 1000).filter(([f]) => f > 4));
    assert.ok(Math.abs(found - hz) < 0.2 && Math.abs(amplitude - 0.05) < 0.01, `${hz}: ${found}, ${amplitude}`);
  }
  assert.deepEqual(spectrum([1, 2, 3], 1000), []);
});

test("ticks are round and lie within", () => {
  assert.deepEqual(ticks(-1.08, 1.08, 5).map((value) => +value.toFixed(6)), [-1, -0.5, 0, 0.5, 1]);
  for (const [least, most] of [[0, 1e-3], [-7, 1234], [3.2, 3.3]]) {
    const found = ticks(least, most, 5);
    assert.ok(found.length >= 2 && found.every((value) => value >= least - 1e-9 && value <= most + 1e-9), String(found));
  }
});
