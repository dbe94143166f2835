// The flight from above, on a canvas: what doesn't move is drawn once for a while, vehicles at every frame.
"use strict";
const PREDICTED_S = 10;
const REDRAWN_MS = 500;
const CROWD = 30; // of more vehicles only the leader's and the selected one's future is drawn
const SLOW_MS = 40, FAST_MS = 18, SETTLES_MS = 1500; // a slow machine draws the plan at fewer pixels
const OVER = 1.6; // size of the layer beneath, relative to what is seen: so following needs no redrawing

class Plan {
  constructor(place, store) {
    this.store = store;
    this.canvas = element("canvas", { class: "plan", tabindex: "0", "aria-label": "Plan of the flight, north up" });
    place.append(this.canvas);
    this.layer = document.createElement("canvas");
    this.drawn = null;
    this.camera = new PlanCamera(this.canvas, () => { this.drawn = null; });
    this.ground = null;
    this.tiles = new Tiles(store.meta, () => { this.drawn = null; });
    this.quality = 1;
    this.frame_ms = 25;
    this.adapts = 0; // when it next looks whether to draw at other pixels
    this.patience_ms = SETTLES_MS;
  }

  get visible() { return !this.canvas.hidden; }

  show(visible) { this.canvas.hidden = !visible; }

  resize() {
    this.adapt();
    const ratio = Math.min(2, window.devicePixelRatio || 1) * this.quality;
    const width = Math.round(this.camera.width * ratio), height = Math.round(this.camera.height * ratio);
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width; this.canvas.height = height;
      this.drawn = null;
    }
    return ratio;
  }

  // Draw at half the pixels each way if frames take long: whole pixels, which are enlarged without being mixed, since
  // mixing costs a browser without a graphics processor more than the drawing. Going back is tried, ever more seldom.
  adapt() {
    const now = performance.now();
    if (this.before && now - this.before < 500) this.frame_ms += 0.05 * (now - this.before - this.frame_ms);
    this.before = now;
    if (now < this.adapts) return;
    if (this.frame_ms > SLOW_MS && this.quality === 1) {
      this.quality = 0.5;
      this.patience_ms *= 2;
      this.adapts = now + this.patience_ms;
    } else if (this.frame_ms < FAST_MS && this.quality < 1) {
      this.quality = 1;
      this.adapts = now + SETTLES_MS;
    }
    this.canvas.classList.toggle("coarse", this.quality < 1);
  }

  fitFormation(places) {
    const box = boxOf(places);
    if (!box || !this.camera.width) return;
    this.camera.fit(box, 0.45);
    this.camera.scale = Math.min(this.camera.scale, this.camera.height / 60);
    this.camera.following = true;
    this.camera.fitted = true;
  }

  fitAll(places) {
    const scene = this.store.meta.scene;
    const box = boxOf([...places, ...(scene.path || []), ...(scene.fence || []).flatMap((area) => area.corners), ...this.trackEnds()]);
    if (!box) return;
    this.camera.following = false;
    this.camera.fit(box, 0.1);
    this.camera.fitted = true;
  }

  *trackEnds() {
    const ticks = this.store.overview;
    for (let i = 0; i < ticks.count; i += Math.max(1, ticks.count >> 6)) {
      for (let v = 0; v < this.store.vehicles.length; v++) yield [...ticks.values.subarray(i * ticks.width + v * this.store.width, i * ticks.width + v * this.store.width + 2)];
    }
  }

  draw(view) {
    const ratio = this.resize(), context = this.canvas.getContext("2d", { alpha: false }), camera = this.camera;
    if (!this.canvas.width) return;
    if (!camera.fitted && view.places.some(([north]) => Number.isFinite(north))) this.fitFormation(view.places);
    camera.follow(...view.centre);
    this.beneath(view, ratio);
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.fillStyle = view.colours.paper;
    context.fillRect(0, 0, this.canvas.width, this.canvas.height);
    const shift = { x: (this.drawn.east - camera.east) * camera.scale, y: (camera.north - this.drawn.north) * camera.scale };
    const edge = { x: (this.layer.width / ratio - camera.width) / 2, y: (this.layer.height / ratio - camera.height) / 2 };
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.drawImage(this.layer, shift.x - edge.x, shift.y - edge.y, this.layer.width / ratio, this.layer.height / ratio);
    this.separations(context, view);
    this.vehicles(context, view);
    this.scaleBar(context, view);
  }

  // Draw ground, path, fence and tracks, unless they are drawn already where they are seen.
  beneath(view, ratio) {
    const camera = this.camera, drawn = this.drawn, now = performance.now();
    const far = drawn && Math.max(Math.abs(drawn.east - camera.east) / camera.width, Math.abs(drawn.north - camera.north) / camera.height) * camera.scale;
    const stale = !drawn || drawn.scale !== camera.scale || drawn.dark !== view.colours.dark || far > (OVER - 1) / 2;
    if (!stale && (now - drawn.at < REDRAWN_MS || drawn.time === view.time_s)) return;
    this.layer.width = this.canvas.width * OVER; this.layer.height = this.canvas.height * OVER;
    const ticks = this.store.overview, last = ticks.before(view.time_s);
    const ends = this.store.vehicles.map((_, v) => (last < 0 ? [NaN, NaN] : [...ticks.values.subarray(last * ticks.width + v * this.store.width, last * ticks.width + v * this.store.width + 2)]));
    this.drawn = { east: camera.east, north: camera.north, scale: camera.scale, dark: view.colours.dark, at: now, time: view.time_s, ends };
    const context = this.layer.getContext("2d", { alpha: false });
    context.fillStyle = view.colours.paper;
    context.fillRect(0, 0, this.layer.width, this.layer.height);
    context.setTransform(ratio, 0, 0, ratio, this.layer.width / 2, this.layer.height / 2);
    const at = ([north, east]) => [(east - camera.east) * camera.scale, (camera.north - north) * camera.scale];
    const reach = { north: this.layer.height / ratio / 2 / camera.scale, east: this.layer.width / ratio / 2 / camera.scale };
    this.terrain(context, at, view);
    this.tiles.draw(context, at, { north: [camera.north - reach.north, camera.north + reach.north], east: [camera.east - reach.east, camera.east + reach.east] }, camera.scale * ratio);
    this.grid(context, at, view, ratio);
    const scene = this.store.meta.scene;
    for (const area of scene.fence || []) {
      this.line(context, area.corners, at, view.colours.bad, 1.5, area.inside ? [8, 5] : []);
      if (!area.inside) { context.globalAlpha = 0.12; context.fillStyle = view.colours.bad; context.fill(); context.globalAlpha = 1; }
    }
    if (scene.path) this.line(context, scene.path, at, view.colours.faint, 2, [10, 6]);
    this.tracks(context, at, view);
  }

  line(context, points, at, colour, width, dash = []) {
    context.beginPath();
    points.forEach((point, i) => (i ? context.lineTo(...at(point)) : context.moveTo(...at(point))));
    context.strokeStyle = colour; context.lineWidth = width; context.setLineDash(dash);
    context.stroke();
    context.setLineDash([]);
  }

  terrain(context, at, view) {
    const ground = this.store.meta.scene.ground;
    if (!ground) return;
    if (!this.ground || this.ground.dark !== view.colours.dark) this.ground = { image: groundImage(ground, view.colours.dark), dark: view.colours.dark };
    const rows = ground.height.length / ground.columns;
    const [x, y] = at([ground.south + rows * ground.cell, ground.west]);
    context.imageSmoothingEnabled = true;
    context.drawImage(this.ground.image, x, y, ground.columns * ground.cell * this.camera.scale, rows * ground.cell * this.camera.scale);
  }

  grid(context, at, view, ratio) {
    const step = niceStep(90 / this.camera.scale), half = [this.layer.width, this.layer.height].map((size) => size / ratio / 2);
    context.strokeStyle = view.colours.line; context.lineWidth = 1;
    context.beginPath();
    const reach = { east: half[0] / this.camera.scale, north: half[1] / this.camera.scale };
    for (let e = Math.ceil((this.camera.east - reach.east) / step) * step; e < this.camera.east + reach.east; e += step) {
      const [x] = at([0, e]); context.moveTo(x, -half[1]); context.lineTo(x, half[1]);
    }
    for (let n = Math.ceil((this.camera.north - reach.north) / step) * step; n < this.camera.north + reach.north; n += step) {
      const [, y] = at([n, 0]); context.moveTo(-half[0], y); context.lineTo(half[0], y);
    }
    context.stroke();
  }

  tracks(context, at, view) {
    const { store } = this, ticks = store.overview, end = ticks.before(view.time_s) + 1;
    context.lineWidth = store.vehicles.length > 30 ? 0.8 : 1.4;
    context.globalAlpha = 0.75;
    for (let v = 0; v < store.vehicles.length; v++) {
      context.beginPath();
      let pen = false;
      for (let i = 0; i < end; i++) {
        const k = i * ticks.width + v * store.width, north = ticks.values[k], east = ticks.values[k + 1];
        if (!Number.isFinite(north)) { pen = false; continue; }
        const [x, y] = at([north, east]);
        if (pen) context.lineTo(x, y); else context.moveTo(x, y);
        pen = true;
      }
      context.strokeStyle = colourOf(store, v, view.colours);
      context.stroke();
    }
    context.globalAlpha = 1;
  }

  separations(context, view) {
    const camera = this.camera;
    for (const pair of view.pairs) {
      const [a, b] = [view.places[pair.a], view.places[pair.b]];
      const close = pair.distance < pair.limit, gives = pair.gives;
      context.strokeStyle = close ? view.colours.bad : view.colours.warn;
      context.lineWidth = close || gives ? 2.5 : 1.2;
      context.setLineDash(gives ? [] : [3, 4]);
      context.beginPath();
      context.moveTo(camera.x(a[1]), camera.y(a[0]));
      context.lineTo(camera.x(b[1]), camera.y(b[0]));
      context.stroke();
      if (camera.scale * pair.distance > 40) {
        context.fillStyle = context.strokeStyle; context.font = font(11); context.textAlign = "center";
        context.fillText(`${pair.distance.toFixed(1)} m`, (camera.x(a[1]) + camera.x(b[1])) / 2, (camera.y(a[0]) + camera.y(b[0])) / 2 - 4);
      }
    }
    context.setLineDash([]);
  }

  vehicles(context, view) {
    const camera = this.camera, { store } = this, crowd = store.vehicles.length > CROWD, size = (crowd ? 6 : 9) * em();
    for (let v = 0; v < store.vehicles.length; v++) {
      const [north, east, , heading, speed] = view.places[v];
      if (!Number.isFinite(north)) continue;
      const x = camera.x(east), y = camera.y(north), colour = colourOf(store, v, view.colours);
      const slot = view.slots[v], [trackNorth, trackEast] = this.drawn.ends[v];
      if (Number.isFinite(trackNorth)) {
        context.strokeStyle = colour; context.lineWidth = 1.2;
        context.beginPath(); context.moveTo(camera.x(trackEast), camera.y(trackNorth)); context.lineTo(x, y); context.stroke();
      }
      if (Number.isFinite(slot[0])) {
        const sx = camera.x(slot[1]), sy = camera.y(slot[0]);
        context.strokeStyle = colour; context.lineWidth = 1.2;
        context.beginPath(); context.arc(sx, sy, size, 0, TURN); context.stroke();
        context.beginPath(); context.moveTo(sx, sy); context.lineTo(x, y); context.stroke();
      }
      if (!Number.isFinite(heading)) continue;
      if (speed > 0.5 && (!crowd || v === view.selected || store.vehicles[v] === store.leaderName)) {
        context.setLineDash([2, 5]); context.strokeStyle = colour; context.lineWidth = 1.2;
        context.beginPath(); context.moveTo(x, y);
        for (const [n, e] of view.ahead(v, PREDICTED_S)) context.lineTo(camera.x(e), camera.y(n));
        context.stroke(); context.setLineDash([]);
      }
      arrow(context, x, y, heading, size, colour, view.colours.paper);
      if (v === view.selected || view.yields(v)) {
        context.strokeStyle = view.yields(v) ? view.colours.warn : view.colours.ink; context.lineWidth = 2;
        context.beginPath(); context.arc(x, y, size + 6, 0, TURN); context.stroke();
      }
    }
  }

  scaleBar(context, view) {
    const step = niceStep(90 / this.camera.scale), length = step * this.camera.scale, y = this.camera.height - 14;
    context.strokeStyle = view.colours.ink; context.fillStyle = view.colours.ink; context.lineWidth = 2;
    context.beginPath(); context.moveTo(12, y); context.lineTo(12 + length, y); context.stroke();
    context.font = font(12); context.textAlign = "left";
    context.fillText(step >= 1000 ? `${step / 1000} km` : `${step} m`, 12, y - 5);
    context.textAlign = "right";
    context.fillText("N ↑", this.camera.width - 10, y);
  }

  project(v, view) {
    const [north, east] = view.places[v];
    return Number.isFinite(north) ? [this.camera.x(east), this.camera.y(north)] : null;
  }
}

function arrow(context, x, y, heading, size, colour, edge) {
  const sin = Math.sin(heading), cos = Math.cos(heading);
  const at = (forward, right) => [x + forward * sin + right * cos, y - forward * cos + right * sin];
  context.beginPath();
  context.moveTo(...at(1.3 * size, 0)); context.lineTo(...at(-size, 0.8 * size)); context.lineTo(...at(-0.45 * size, 0)); context.lineTo(...at(-size, -0.8 * size));
  context.closePath();
  context.fillStyle = colour; context.fill();
  context.strokeStyle = edge; context.lineWidth = 1; context.stroke();
}

function niceStep(wanted) {
  const power = 10 ** Math.floor(Math.log10(wanted));
  return [1, 2, 5, 10].map((digit) => digit * power).find((step) => step >= wanted) || 10 * power;
}

// Heights as colours, lit from north-west.
function groundImage(ground, dark) {
  const rows = ground.height.length / ground.columns, image = element("canvas");
  image.width = ground.columns; image.height = rows;
  const context = image.getContext("2d"), pixels = context.createImageData(ground.columns, rows);
  const known = ground.height.filter((height) => height !== null), low = Math.min(...known), span = Math.max(1, Math.max(...known) - low);
  const height = (row, column) => ground.height[Math.max(0, Math.min(rows - 1, row)) * ground.columns + Math.max(0, Math.min(ground.columns - 1, column))] ?? low;
  const ends = dark ? [[38, 46, 40], [104, 86, 62]] : [[237, 242, 228], [185, 162, 131]];
  for (let row = 0; row < rows; row++) {
    for (let column = 0; column < ground.columns; column++) {
      const slope = (height(row + 1, column) - height(row, column) - height(row, column + 1) + height(row, column)) / ground.cell;
      const share = (height(row, column) - low) / span, lit = 1 - Math.max(-0.3, Math.min(0.3, slope));
      const k = 4 * ((rows - 1 - row) * ground.columns + column);
      for (let c = 0; c < 3; c++) pixels.data[k + c] = Math.min(255, (ends[0][c] + share * (ends[1][c] - ends[0][c])) * lit);
      pixels.data[k + 3] = 255;
    }
  }
  context.putImageData(pixels, 0, 0);
  return image;
}
