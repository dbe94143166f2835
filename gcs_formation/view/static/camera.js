// Follows the formation, zooms and moves by pointer, wheel and keys: the plan's eye.
"use strict";
class PlanCamera {
  constructor(canvas, changed) {
    this.canvas = canvas;
    this.changed = changed;
    this.north = 0; this.east = 0; this.scale = 1; // pixels a metre
    this.following = true;
    this.fitted = false;
    this.pointers = new Map();
    this.size = sizeOf(canvas);
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => this.pointers.delete(event.pointerId));
  }

  get width() { return this.size.width; }

  get height() { return this.size.height; }

  x(east) { return this.width / 2 + (east - this.east) * this.scale; }

  y(north) { return this.height / 2 - (north - this.north) * this.scale; }

  wheel(event) {
    event.preventDefault();
    this.zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), event.offsetX, event.offsetY);
  }

  zoom(factor, x = this.width / 2, y = this.height / 2) {
    const scale = Math.min(50, Math.max(1e-4, this.scale * factor));
    if (!this.following) {
      this.east += (x - this.width / 2) * (1 / this.scale - 1 / scale);
      this.north -= (y - this.height / 2) * (1 / this.scale - 1 / scale);
    }
    this.scale = scale;
    this.fitted = true;
    this.changed();
  }

  pan(x, y) {
    this.following = false;
    this.east -= x / this.scale;
    this.north += y / this.scale;
    this.changed();
  }

  down(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  }

  move(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const others = [...this.pointers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
    const now = { x: event.clientX, y: event.clientY };
    if (others.length) {
      const far = (p) => Math.hypot(p.x - others[0].x, p.y - others[0].y);
      this.zoom(far(now) / Math.max(1, far(before)));
    } else if (this.pointers.get(event.pointerId).moved || Math.hypot(now.x - before.x, now.y - before.y) > 3) {
      this.pan(now.x - before.x, now.y - before.y);
      now.moved = true;
    } else return;
    this.pointers.set(event.pointerId, now);
  }

  // Show a rectangle of metres, with a margin.
  fit(box, margin = 0.22) {
    const high = Math.max(box.north[1] - box.north[0], 20), wide = Math.max(box.east[1] - box.east[0], 20);
    this.north = (box.north[0] + box.north[1]) / 2;
    this.east = (box.east[0] + box.east[1]) / 2;
    this.scale = Math.min(this.width / wide, this.height / high) * (1 - margin);
    if (!(this.scale > 0)) this.scale = 1;
    this.changed();
  }

  follow(north, east) {
    if (!this.following || !Number.isFinite(north)) return;
    this.north = north;
    this.east = east;
  }
}

function boxOf(places) {
  const box = { north: [Infinity, -Infinity], east: [Infinity, -Infinity] };
  for (const [north, east] of places) {
    if (!Number.isFinite(north) || !Number.isFinite(east)) continue;
    box.north = [Math.min(box.north[0], north), Math.max(box.north[1], north)];
    box.east = [Math.min(box.east[0], east), Math.max(box.east[1], east)];
  }
  return Number.isFinite(box.north[0]) ? box : null;
}
