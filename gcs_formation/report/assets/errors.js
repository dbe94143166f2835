// Formation errors over time: three panels with one time axis.

const LEVEL = 16;
const MOST_LEVELS = 5;

class ErrorPlot extends View {
  constructor(canvas, data, state) {
    super(canvas, data, state);
    this.all = this.wholeRange();
    this.range = [data.flown_s[0], Math.max(data.flown_s[1], data.flown_s[0] + 1)];
    this.first = [...this.range];
    if (data.steady_s !== null) this.range[0] = data.steady_s;
    this.hover = null;
    this.listen();
  }

  wholeRange() {
    const times = this.data.tracks.t;
    return [times[0], Math.max(times[times.length - 1], times[0] + 1)];
  }

  shown() {
    return this.data.errors.filter((series) => !this.state.hidden.has(series.vehicle));
  }

  layout(width, height) {
    const [left, right, bottom, gap] = [58, 18, 34, 14];
    const names = this.names({ left, wide: width - left - right });
    const top = 12 + LEVEL * (1 + Math.max(...names.map((name) => name.level), -1));
    const tall = (height - top - bottom - 2 * gap) / 3;
    const panels = ["x", "y", "z"].map((axis, i) => ({ axis, top: top + i * (tall + gap), tall }));
    return { left, wide: width - left - right, bottom: height - bottom, panels, names };
  }

  // Places of the marks' names, from the last to the first, so that no line to a name crosses another name.
  names(box) {
    const pen = this.canvas.getContext("2d");
    pen.font = FONT;
    const taken = Array.from({ length: MOST_LEVELS }, () => []);
    const inside = this.data.marks.filter((mark) => mark.t >= this.range[0] && mark.t <= this.range[1]);
    return inside.reverse().map(({ t, label }) => {
      const x = this.x(t, box);
      const wide = pen.measureText(label).width;
      const left = x + wide <= box.left + box.wide ? x + 3 : Math.max(x - wide - 3, box.left);
      const level = taken.findIndex((row) => row.every(([from, to]) => left >= to || left + wide + 8 <= from));
      if (level >= 0) taken[level].push([left, left + wide + 8]);
      return { x, label, left, level };
    });
  }

  x(t, box) {
    return box.left + ((t - this.range[0]) / (this.range[1] - this.range[0])) * box.wide;
  }

  time(x, box) {
    return this.range[0] + ((x - box.left) / box.wide) * (this.range[1] - this.range[0]);
  }

  reach(axis) {
    let low = Infinity;
    let high = -Infinity;
    for (const series of this.shown()) {
      const { t, v } = series[axis];
      const end = Math.min(before(t, this.range[1]) + 1, t.length - 1);
      for (let i = before(t, this.range[0]); i <= end; i += 1) {
        if (v[i] === null || t[i] < this.range[0] || t[i] > this.range[1]) continue;
        low = Math.min(low, v[i]);
        high = Math.max(high, v[i]);
      }
    }
    for (const { from, to, allowed } of this.data.bounds.filter((each) => each.axis === axis)) {
      if (to > this.range[0] && from < this.range[1]) [low, high] = [Math.min(low, -allowed), Math.max(high, allowed)];
    }
    if (low > high) return [-1, 1];
    const margin = Math.max(0.06 * (high - low), 1e-3);
    return [low - margin, high + margin];
  }

  paint() {
    const { pen, width, height } = prepare(this.canvas);
    const colours = theme();
    const box = this.layout(width, height);
    for (const panel of box.panels) this.drawPanel(pen, colours, box, panel);
    this.drawTimeAxis(pen, colours, box);
    this.drawMarks(pen, colours, box);
    this.drawCursor(pen, colours, box);
  }

  drawPanel(pen, colours, box, panel) {
    const [low, high] = this.reach(panel.axis);
    const y = (value) => panel.top + ((high - value) / (high - low)) * panel.tall;
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    pen.lineWidth = 1;
    for (const tick of ticks(low, high, panel.tall / 22)) {
      pen.strokeStyle = Math.abs(tick.value) < 1e-12 ? colours.soft : colours.grid;
      line(pen, box.left, y(tick.value), box.left + box.wide, y(tick.value));
      pen.fillStyle = colours.soft;
      pen.fillText(tick.text, box.left - 6, y(tick.value));
    }
    pen.save();
    pen.beginPath();
    pen.rect(box.left, panel.top, box.wide, panel.tall);
    pen.clip();
    this.drawBounds(pen, colours, panel.axis, box, y);
    const few = this.data.vehicles.length <= 5;
    for (const series of this.shown()) {
      pen.lineWidth = few ? 3.2 - 0.5 * series.vehicle : 1.2; // lines that coincide stay visible
      pen.strokeStyle = this.state.colour(series.vehicle, colours);
      this.drawSeries(pen, series[panel.axis], box, y);
    }
    pen.restore();
    pen.textAlign = "right";
    const name = { x: "x, forward", y: "y, right", z: "z, height" }[panel.axis];
    pen.fillStyle = colours.card;
    pen.globalAlpha = 0.8;
    pen.fillRect(box.left + box.wide - pen.measureText(name).width - 8, panel.top, pen.measureText(name).width + 8, 18);
    pen.globalAlpha = 1;
    pen.fillStyle = colours.ink;
    pen.fillText(name, box.left + box.wide - 4, panel.top + 9);
  }

  // Bounds on errors after a gust on followers only: allowed, and (dotted) least possible under any law.
  drawBounds(pen, colours, axis, box, y) {
    pen.strokeStyle = colours.ink;
    for (const bound of this.data.bounds.filter((each) => each.axis === axis)) {
      for (const [size, dash] of [[bound.allowed, [6, 3]], [bound.least, [1, 3]]]) {
        pen.setLineDash(dash);
        for (const v of [-size, size]) line(pen, this.x(bound.from, box), y(v), this.x(bound.to, box), y(v));
      }
    }
    pen.setLineDash([]);
  }

  drawSeries(pen, { t, v }, box, y) {
    const end = Math.min(before(t, this.range[1]) + 1, t.length - 1);
    pen.beginPath();
    let down = false;
    for (let i = before(t, this.range[0]); i <= end; i += 1) {
      if (v[i] === null) down = false;
      else if (down) pen.lineTo(this.x(t[i], box), y(v[i]));
      else {
        pen.moveTo(this.x(t[i], box), y(v[i]));
        down = true;
      }
    }
    pen.stroke();
  }

  drawTimeAxis(pen, colours, box) {
    pen.fillStyle = colours.soft;
    pen.textBaseline = "top";
    pen.textAlign = "center";
    for (const tick of ticks(...this.range, box.wide / 90)) {
      pen.fillText(tick.text, this.x(tick.value, box), box.bottom + 4);
    }
    pen.fillText(this.data.begun ? "mission time, s" : "time, s", box.left + box.wide / 2, box.bottom + 19);
  }

  drawMarks(pen, colours, box) {
    pen.textAlign = "left";
    pen.textBaseline = "top";
    pen.strokeStyle = colours.soft;
    pen.fillStyle = colours.soft;
    for (const { x, label, left, level } of box.names) {
      const top = box.panels[0].top - LEVEL * (level + 1);
      pen.setLineDash([4, 3]);
      line(pen, x, level < 0 ? box.panels[0].top : top, x, box.bottom);
      pen.setLineDash([]);
      if (level >= 0) pen.fillText(label, left, top);
    }
  }

  drawCursor(pen, colours, box) {
    const vertical = (t, colour) => {
      if (t < this.range[0] || t > this.range[1]) return;
      pen.strokeStyle = colour;
      line(pen, this.x(t, box), box.panels[0].top, this.x(t, box), box.bottom);
    };
    pen.lineWidth = 1;
    vertical(this.state.time, colours.accent);
    if (this.hover !== null) vertical(this.hover, colours.soft);
    if (this.drag && !this.drag.pan) {
      pen.fillStyle = colours.accent;
      pen.globalAlpha = 0.15;
      const from = Math.max(this.drag.from, box.left);
      pen.fillRect(from, box.panels[0].top, this.drag.to - from, box.bottom - box.panels[0].top);
      pen.globalAlpha = 1;
    }
  }

  // Shows the range from..to, kept inside the flight; returns whether that changed anything.
  zoom(from, to) {
    const least = 0.5;
    if (to - from < least) [from, to] = [(from + to - least) / 2, (from + to + least) / 2];
    const next = [Math.max(from, this.all[0]), Math.min(to, this.all[1])];
    if (next[0] >= next[1] || (next[0] === this.range[0] && next[1] === this.range[1])) return false;
    this.range = next;
    this.draw();
    return true;
  }

  readout(t) {
    const values = this.shown().map((series) => ({
      name: this.data.vehicles[series.vehicle].name,
      errors: ["x", "y", "z"].map((axis) => between(series[axis].t, series[axis].v, t)),
    }));
    const size = (row) => Math.hypot(...row.errors.map((error) => error ?? 0));
    const most = 8;
    const rows = values.length > most ? values.sort((a, b) => size(b) - size(a)).slice(0, most) : values;
    const cell = (error) => (error === null ? "\u2013" : signed(error, 3)).padStart(9);
    const lines = rows.map((row) => row.name.padEnd(7) + row.errors.map(cell).join(""));
    const more = values.length > most ? [`and ${values.length - most} with smaller errors`] : [];
    return [`${signed(t, 1)} s`, "".padEnd(7) + ["x, m", "y, m", "z, m"].map((n) => n.padStart(9)).join(""), ...lines, ...more].join("\n");
  }

  box() {
    return this.layout(this.canvas.clientWidth, this.canvas.clientHeight);
  }

  listen() {
    const { canvas } = this;
    canvas.addEventListener("pointerdown", (event) => this.press(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerup", (event) => this.release(event));
    canvas.addEventListener("pointercancel", () => { this.drag = null; this.draw(); });
    canvas.addEventListener("pointerleave", (event) => { this.hover = null; showTooltip(event, ""); this.draw(); });
    canvas.addEventListener("dblclick", () => { this.range = [...this.first]; if (!this.zoom(...this.all)) this.draw(); });
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
  }

  press(event) {
    const { x } = place(event, this.canvas);
    this.drag = { from: x, to: x, pan: event.shiftKey, range: [...this.range] };
    this.canvas.setPointerCapture(event.pointerId);
  }

  move(event) {
    const { x } = place(event, this.canvas);
    const box = this.box();
    this.hover = Math.min(Math.max(this.time(x, box), this.range[0]), this.range[1]);
    if (this.drag) {
      this.drag.to = Math.min(Math.max(x, box.left), box.left + box.wide);
      if (this.drag.pan) this.pan(x, box);
    }
    this.draw();
    showTooltip(event, this.drag ? "" : this.readout(this.hover));
  }

  pan(x, box) {
    const [from, to] = this.drag.range;
    const wanted = ((this.drag.from - x) / box.wide) * (to - from);
    const shift = Math.min(Math.max(wanted, this.all[0] - from), this.all[1] - to);
    this.zoom(from + shift, to + shift);
  }

  release() {
    const { drag } = this;
    this.drag = null;
    if (!drag || drag.pan) return;
    const [from, to] = [drag.from, drag.to].sort((a, b) => a - b).map((x) => this.time(x, this.box()));
    if (Math.abs(drag.to - drag.from) > 5) this.zoom(from, to);
    else this.state.setTime(to);
  }

  wheel(event) {
    const at = this.time(place(event, this.canvas).x, this.box());
    const factor = Math.exp(event.deltaY * 0.0015);
    if (this.zoom(at - (at - this.range[0]) * factor, at + (this.range[1] - at) * factor)) event.preventDefault();
  }
}

function line(pen, x1, y1, x2, y2) {
  pen.beginPath();
  pen.moveTo(x1, y1);
  pen.lineTo(x2, y2);
  pen.stroke();
}
