// The flight in space: tracks over the ground, heights stretched, turned by dragging.

// Margin of the canvas for the vehicles' marks and the text, in pixels.
const MARGIN = 40;

class SpaceView extends View {
  constructor(canvas, data, state) {
    super(canvas, data, state);
    [this.low, this.top] = data.ground ? extent(known(data.ground.height)) : [extent(this.all("height"))[0] - 10, 0];
    this.listen();
    this.reset();
  }

  all(name) {
    return this.data.tracks.vehicles.flatMap((track) => known(track[name]));
  }

  // Shows everything, from the side where the flight is widest.
  reset() {
    const [north, east, height] = ["north", "east", "height"].map((name) => extent(this.all(name)));
    this.centre = { north: (north[0] + north[1]) / 2, east: (east[0] + east[1]) / 2, height: (this.low + height[1]) / 2 };
    this.long = Math.max(north[1] - north[0], east[1] - east[0], 20);
    this.stretch = Math.max(1, (0.2 * this.long) / Math.max(height[1] - this.low, 1));
    [this.turn, this.tilt, this.zoom] = [north[1] - north[0] > east[1] - east[0] ? 1.1 : 0.35, 0.5, 1];
    this.shift = { x: 0, y: 0 };
    this.fit = null;
  }

  // The scale that fits all tracks and the ground below them into the canvas, and the shift that centres them.
  fitted() {
    [this.scale, this.shift] = [1, { x: 0, y: 0 }];
    const seen = this.data.tracks.vehicles.flatMap((track) => track.north.flatMap((north, k) => (
      north === null ? [] : [track.height[k], track.below[k] ?? this.low].map((up) => this.project(north, track.east[k], up ?? this.low))
    )));
    const [x, y] = ["x", "y"].map((name) => extent(seen.map((point) => point[name])));
    const scale = Math.min((this.width - 2 * MARGIN) / Math.max(x[1] - x[0], 1), (this.height - 2 * MARGIN) / Math.max(y[1] - y[0], 1));
    const centred = (middle, side) => scale * (side / 2 - middle);
    return { scale, x: centred((x[0] + x[1]) / 2, this.width), y: centred((y[0] + y[1]) / 2, this.height) };
  }

  // Projects a place onto the canvas (orthographic), seen from `tilt` above the horizontal.
  project(north, east, height) {
    const [cos, sin] = [Math.cos(this.turn), Math.sin(this.turn)];
    const [n, e] = [north - this.centre.north, east - this.centre.east];
    const up = (height - this.centre.height) * this.stretch * Math.cos(this.tilt);
    return {
      x: this.width / 2 + this.shift.x + (e * cos + n * sin) * this.scale,
      y: this.height / 2 + this.shift.y - ((n * cos - e * sin) * Math.sin(this.tilt) + up) * this.scale,
    };
  }

  paint() {
    const { pen, width, height } = prepare(this.canvas);
    const colours = theme();
    [this.width, this.height] = [width, height];
    if (!this.fit || this.fit.width !== width || this.fit.height !== height) {
      const { scale, x, y } = this.fitted();
      [this.fit, this.shift] = [{ scale, width, height }, { x, y }];
    }
    this.scale = this.zoom * this.fit.scale;
    this.drawGround(pen);
    const places = placesAt(this.data.tracks, this.state.time);
    this.data.tracks.vehicles.forEach((track, i) => { if (!this.state.hidden.has(i)) this.drawTrack(pen, colours, track, i); });
    places.forEach((found, i) => { if (found && !this.state.hidden.has(i)) this.drawVehicle(pen, colours, found, i); });
    this.drawCompass(pen, colours);
  }

  // Draws the ground's cells from the farthest to the nearest, so that hills hide what is behind them.
  drawGround(pen) {
    const { ground } = this.data;
    if (!ground) return;
    const { columns, height, cell, south, west } = ground;
    const rows = height.length / columns;
    const order = (count, away) => [...Array(count).keys()].map((i) => (away ? count - 1 - i : i));
    const corners = height.map((value, i) => {
      const [row, column] = [Math.floor(i / columns), i % columns];
      return this.project(south + row * cell, west + column * cell, value ?? this.low);
    });
    for (const row of order(rows - 1, Math.cos(this.turn) > 0)) {
      for (const column of order(columns - 1, Math.sin(this.turn) < 0)) {
        const at = row * columns + column;
        pen.fillStyle = pen.strokeStyle = this.shade(at, columns);
        pen.beginPath();
        for (const i of [at, at + 1, at + columns + 1, at + columns]) pen.lineTo(corners[i].x, corners[i].y);
        pen.fill();
        pen.stroke();
      }
    }
  }

  // A cell's colour: lit from the north-west on slopes as drawn (stretched); higher cells are darker.
  shade(at, columns) {
    const { height, cell } = this.data.ground;
    const [here, north, east] = [at, at + columns, at + 1].map((i) => height[i] ?? this.low);
    const light = Math.min(1, Math.max(0, 0.5 + (0.35 * this.stretch * (east - north)) / cell));
    const high = (here - this.low) / Math.max(this.top - this.low, 1);
    return `hsl(${60 - 25 * high} 28% ${62 + 26 * light - 14 * high}%)`;
  }

  drawTrack(pen, colours, track, i) {
    const now = before(this.data.tracks.t, this.state.time) + 1;
    const trace = (from, to, heights) => {
      pen.beginPath();
      for (let k = from; k < to; k += 1) {
        if (track.north[k] === null || heights[k] === null) continue;
        const { x, y } = this.project(track.north[k], track.east[k], heights[k]);
        pen.lineTo(x, y);
      }
      pen.stroke();
    };
    pen.lineWidth = 1;
    pen.strokeStyle = "#808080";
    pen.globalAlpha = 0.6;
    trace(0, track.below.length, track.below);
    pen.strokeStyle = this.state.colour(i, colours);
    pen.globalAlpha = 0.35;
    trace(now - 1, track.north.length, track.height);
    pen.lineWidth = 1.6;
    pen.globalAlpha = 1;
    trace(0, now, track.height);
  }

  drawVehicle(pen, colours, found, i) {
    const { x, y } = this.project(found.north, found.east, found.height ?? this.low);
    const foot = this.project(found.north, found.east, found.below ?? this.low);
    pen.strokeStyle = colours.soft;
    pen.lineWidth = 1;
    line(pen, x, y, foot.x, foot.y);
    pen.fillStyle = this.state.colour(i, colours);
    pen.beginPath();
    pen.arc(x, y, 4, 0, 2 * Math.PI);
    pen.fill();
  }

  drawCompass(pen, colours) {
    const [x, y, long] = [this.width - 34, 34, 20];
    const [east, north] = [long * Math.sin(this.turn), long * Math.cos(this.turn) * Math.sin(this.tilt)];
    pen.strokeStyle = pen.fillStyle = colours.ink;
    pen.lineWidth = 1.5;
    line(pen, x - east / 2, y + north / 2, x + east / 2, y - north / 2);
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.fillText("N", x + 0.95 * east, y - 0.95 * north);
    pen.textAlign = "right";
    const times = this.stretch < 9.95 ? this.stretch.toFixed(1) : this.stretch.toFixed(0);
    pen.fillText(`heights × ${times}`, this.width - 10, this.height - 10);
  }

  listen() {
    const { canvas } = this;
    canvas.addEventListener("pointerdown", (event) => {
      this.drag = { ...place(event, canvas), turn: this.turn, tilt: this.tilt, shift: { ...this.shift } };
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { this.drag = null; });
    canvas.addEventListener("pointerleave", (event) => showTooltip(event, ""));
    canvas.addEventListener("dblclick", () => { this.reset(); this.draw(); });
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
  }

  move(event) {
    const { x, y } = place(event, this.canvas);
    if (this.drag) {
      const [right, down] = [x - this.drag.x, y - this.drag.y];
      if (event.shiftKey) this.shift = { x: this.drag.shift.x + right, y: this.drag.shift.y + down };
      else {
        this.turn = this.drag.turn - right * 0.008;
        this.tilt = Math.min(Math.PI / 2, Math.max(0.05, this.drag.tilt + down * 0.008));
      }
      this.draw();
    }
    const at = (found) => this.project(found.north, found.east, found.height ?? this.low);
    showTooltip(event, this.drag ? "" : nearest(this.data, this.state, at, x, y));
  }

  wheel(event) {
    event.preventDefault();
    const { x, y } = place(event, this.canvas);
    const before = this.zoom;
    this.zoom = Math.min(Math.max(before * Math.exp(-event.deltaY * 0.0015), 0.3), 200);
    const grown = this.zoom / before;
    this.shift = {
      x: (this.shift.x + this.width / 2 - x) * grown + x - this.width / 2,
      y: (this.shift.y + this.height / 2 - y) * grown + y - this.height / 2,
    };
    this.draw();
  }
}
