// SPDX-License-Identifier: MIT
// band.js - a curve with more values than places on the screen: each place keeps the least and the most, so that no peak is lost, and what it began and ended with, so that a flank has no teeth.

// A place with one more value: [least, most, first, last].
export const widened = (place, value) => (place === null ? [value, value, value, value] : [Math.min(place[0], value), Math.max(place[1], value), place[2], value]);

// The path of places; null: nothing there. x(place), y(value)
export function drawBand(pen, places, x, y) {
  pen.beginPath();
  let isDown = false;
  places.forEach((place, at) => {
    if (place === null) return;
    const [least, most, first, last] = place;
    if (isDown) pen.lineTo(x(at), y(first)); else pen.moveTo(x(at), y(first));
    for (const value of least === most ? [] : [least, most, last]) pen.lineTo(x(at), y(value));
    isDown = true;
  });
  pen.stroke();
}
