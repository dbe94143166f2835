// The flight from above, north up: tracks, path, and the vehicles at the chosen time.

class PlanView extends View {
  constructor(canvas, data, state) {
    super(canvas, data, state);
    this.centre = { north: 0, east: 0 };
    this.scale = null; // pixels per metre; null until the canvas has a size
    this.following = false;
    this.relief = data.ground && relief(data.ground);
    this.listen();
  }

  fit() {
    const { width, height } = this.size();
    const all = (name) => extent(this.data.tracks.vehicles.flatMap((track) => known(track[name])));
    const [[south, north], [west, east]] = [all("north"), all("east")];
    this.centre = { north: (south + north) / 2, east: (west + east) / 2 };
    this.scale = Math.min((width - 70) / Math.max(east - west, 20), (height - 70) / Math.max(north - south, 20));
  }

  size() {
    return { width: this.canvas.clientWidth, height: this.canvas.clientHeight };
  }

  places(t) {
    return placesAt(this.data.tracks, t);
  }

  follow(on) {
    this.following = on;
    if (on) {
      const known = this.places(this.state.time).filter((found, i) => found && !this.state.hidden.has(i));
      const middle = this.middle(known);
      const far = known.map((p) => Math.hypot(p.north - middle.north, p.east - middle.east)).sort((a, b) => a - b);
      const reach = Math.max(60, 2.6 * (far[Math.floor(far.length * 0.9)] ?? 0));
      const { width, height } = this.size();
      this.scale = Math.min(width, height) / (1.25 * reach);
    } else this.fit();
    this.draw();
  }

  middle(places) {
    const median = (name) => {
      const values = places.map((p) => p[name]).sort((a, b) => a - b);
      return values.length ? (values[(values.length - 1) >> 1] + values[values.length >> 1]) / 2 : 0;
    };
    return { north: median("north"), east: median("east") };
  }

  x(east) { return this.canvas.clientWidth / 2 + (east - this.centre.east) * this.scale; }

  y(north) { return this.canvas.clientHeight / 2 - (north - this.centre.north) * this.scale; }

  paint() {
    if (!this.scale) this.fit();
    const places = this.places(this.state.time);
    if (this.following) this.centre = this.middle(places.filter((found, i) => found && !this.state.hidden.has(i)));
    const { pen, width, height } = prepare(this.canvas);
    const colours = theme();
    this.drawGround(pen);
    this.drawGrid(pen, colours, width, height);
    pen.strokeStyle = colours.path;
    pen.globalAlpha = 0.35;
    pen.lineWidth = 5;
    this.trace(pen, this.data.path, 0, this.data.path.north.length);
    this.drawTracks(pen, colours, places);
    places.forEach((found, i) => { if (found && !this.state.hidden.has(i)) this.drawVehicle(pen, colours, found, i); });
    this.drawScale(pen, colours, width, height);
  }

  drawGrid(pen, colours, width, height) {
    pen.lineWidth = 1;
    pen.strokeStyle = colours.grid;
    const east = distances(this.centre.east - width / 2 / this.scale, this.centre.east + width / 2 / this.scale, width / 110);
    const north = distances(this.centre.north - height / 2 / this.scale, this.centre.north + height / 2 / this.scale, height / 90);
    for (const tick of east) line(pen, this.x(tick.value), 0, this.x(tick.value), height);
    for (const tick of north) line(pen, 0, this.y(tick.value), width, this.y(tick.value));
    pen.fillStyle = colours.soft;
    pen.textAlign = "center";
    pen.textBaseline = "bottom";
    for (const tick of east) if (this.x(tick.value) > 60 && this.x(tick.value) < width - 24) pen.fillText(tick.text, this.x(tick.value), height - 3);
    pen.textAlign = "left";
    pen.textBaseline = "middle";
    for (const tick of north) if (this.y(tick.value) > 6 && this.y(tick.value) < height - 24) pen.fillText(tick.text, 3, this.y(tick.value));
  }

  drawGround(pen) {
    if (!this.relief) return;
    const { south, west, cell, columns, height } = this.data.ground;
    const rows = height.length / columns;
    const [left, top] = [this.x(west - cell / 2), this.y(south + (rows - 0.5) * cell)];
    pen.drawImage(this.relief, left, top, columns * cell * this.scale, rows * cell * this.scale);
  }

  drawTracks(pen, colours, places) {
    const now = before(this.data.tracks.t, this.state.time);
    this.data.tracks.vehicles.forEach((track, i) => {
      if (this.state.hidden.has(i)) return;
      pen.strokeStyle = this.state.colour(i, colours);
      pen.lineWidth = 1;
      pen.globalAlpha = 0.3;
      this.trace(pen, track, 0, track.north.length);
      pen.lineWidth = 1.4;
      pen.globalAlpha = 1;
      this.trace(pen, track, 0, now + 1, places[i]);
    });
  }

  trace(pen, { north, east }, from, to, last) {
    pen.beginPath();
    let down = false;
    for (let i = from; i < to; i += 1) {
      if (north[i] === null) { down = false; continue; }
      if (down) pen.lineTo(this.x(east[i]), this.y(north[i]));
      else pen.moveTo(this.x(east[i]), this.y(north[i]));
      down = true;
    }
    if (last && down) pen.lineTo(this.x(last.east), this.y(last.north));
    pen.stroke();
    pen.globalAlpha = 1;
  }

  drawVehicle(pen, colours, found, i) {
    pen.save();
    pen.translate(this.x(found.east), this.y(found.north));
    pen.fillStyle = this.state.colour(i, colours);
    if (this.named()) {
      pen.textAlign = "left";
      pen.textBaseline = "middle";
      pen.fillText(this.data.vehicles[i].name, 10, 0);
    }
    pen.rotate(found.heading ?? 0);
    pen.beginPath();
    pen.moveTo(0, -8);
    pen.lineTo(5, 6);
    pen.lineTo(0, 3);
    pen.lineTo(-5, 6);
    pen.closePath();
    pen.fill();
    pen.restore();
  }

  named() {
    return this.scale > 0.6 && this.data.vehicles.length <= 30;
  }

  drawScale(pen, colours, width, height) {
    const longest = 130 / this.scale;
    const power = 10 ** Math.floor(Math.log10(longest));
    const length = power * [5, 2, 1].find((factor) => factor * power <= longest * (1 + 1e-9));
    const [right, y] = [width - 12, height - 26];
    pen.strokeStyle = colours.ink;
    pen.fillStyle = colours.ink;
    pen.lineWidth = 2;
    line(pen, right - length * this.scale, y, right, y);
    pen.textAlign = "right";
    pen.textBaseline = "bottom";
    pen.fillText(length >= 1000 ? `${length / 1000} km` : `${length} m`, right, y - 4);
    pen.textAlign = "center";
    pen.fillText("N", width - 16, 30);
    line(pen, width - 16, 46, width - 16, 32);
    line(pen, width - 20, 37, width - 16, 32);
    line(pen, width - 12, 37, width - 16, 32);
  }

  listen() {
    const { canvas } = this;
    canvas.addEventListener("pointerdown", (event) => {
      this.drag = { ...place(event, canvas), centre: { ...this.centre } };
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerup", () => { this.drag = null; });
    canvas.addEventListener("pointercancel", () => { this.drag = null; });
    canvas.addEventListener("pointerleave", (event) => showTooltip(event, ""));
    canvas.addEventListener("dblclick", () => { this.state.setFollowing(false); });
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
  }

  move(event) {
    const { x, y } = place(event, this.canvas);
    if (this.drag) {
      if (this.following && Math.hypot(x - this.drag.x, y - this.drag.y) > 3) this.state.letGo();
      this.centre = {
        east: this.drag.centre.east - (x - this.drag.x) / this.scale,
        north: this.drag.centre.north + (y - this.drag.y) / this.scale,
      };
      this.draw();
    }
    const at = (found) => ({ x: this.x(found.east), y: this.y(found.north) });
    showTooltip(event, this.drag ? "" : nearest(this.data, this.state, at, x, y));
  }

  wheel(event) {
    event.preventDefault();
    const { x, y } = place(event, this.canvas);
    const { width, height } = this.size();
    const factor = Math.exp(-event.deltaY * 0.0015);
    const next = Math.min(Math.max(this.scale * factor, 1e-4), 50);
    const gain = 1 / this.scale - 1 / next;
    if (!this.following) {
      this.centre = {
        east: this.centre.east + (x - width / 2) * gain,
        north: this.centre.north - (y - height / 2) * gain,
      };
    }
    this.scale = next;
    this.draw();
  }
}

// The ground as an image, one pixel per cell, north up; higher ground has a stronger colour.
function relief({ columns, height }) {
  const rows = height.length / columns;
  const canvas = document.createElement("canvas");
  canvas.width = columns;
  canvas.height = rows;
  const pen = canvas.getContext("2d");
  const image = pen.createImageData(columns, rows);
  const [low, high] = extent(known(height));
  const reach = Math.max(high - low, 1);
  height.forEach((value, i) => {
    const at = 4 * ((rows - 1 - Math.floor(i / columns)) * columns + (i % columns));
    image.data.set([150, 112, 60, value === null ? 0 : Math.round((170 * (value - low)) / reach)], at);
  });
  pen.putImageData(image, 0, 0);
  return canvas;
}
