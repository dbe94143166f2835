// Values over time, by uPlot: errors by axis, setpoint beside response, links.
"use strict";
const MAX_LINES = 12;
const KINDS = {
  errors: { name: "Errors", plots: [["x, m", ["error_x_m"]], ["y, m", ["error_y_m"]], ["z, m", ["error_z_m"]]], of: "followers" },
  setpoints: {
    name: "Setpoint and response", of: "selected",
    plots: [["speed, m/s", ["airspeed_mps", "setpoint_speed_mps"]], ["heading, °", ["heading_rad", "setpoint_heading_rad"]], ["height, m", ["height_m", "setpoint_height_m"]]],
  },
  links: {
    name: "Link", of: "selected",
    plots: [["delay, ms", ["delay_s", "up_s", "down_s", "jitter_s"]], ["loss, %", ["loss"]], ["age, ms", ["age_s"]], ["kbit/s", ["rate_down_kbps", "rate_up_kbps"]]],
  },
};
const SCALES = { _s: 1e3, loss: 100, _rad: 180 / Math.PI };
const WORDS = { airspeed_mps: "flown", heading_rad: "flown", height_m: "flown", delay_s: "one way", up_s: "up", down_s: "down", jitter_s: "jitter", rate_down_kbps: "down", rate_up_kbps: "up" };

function scaleOf(name) {
  const found = Object.keys(SCALES).find((end) => name.endsWith(end));
  return found ? SCALES[found] : 1;
}

class Plots {
  constructor(place, store, seek) {
    this.store = store;
    this.seek = seek;
    this.kind = "errors";
    this.window_s = 60;
    this.charts = [];
    this.body = element("div", { class: "plots" });
    this.legend = element("div", { class: "legend" });
    const kinds = Object.entries(KINDS).map(([kind, { name }]) => element("button", { type: "button", role: "tab", "data-kind": kind, onclick: () => this.choose(kind) }, name));
    const windows = element("select", { "aria-label": "Time shown", onchange: (event) => { this.window_s = Number(event.target.value); this.shown = null; } });
    for (const [value, text] of [[30, "30 s"], [60, "1 min"], [300, "5 min"], [0, "whole flight"]]) windows.append(element("option", { value, selected: value === 60 }, text));
    this.tabs = element("div", { class: "tabs", role: "tablist" }, ...kinds, element("span", { class: "grow" }), windows);
    place.append(this.tabs, this.legend, this.body);
    new ResizeObserver(() => this.resize()).observe(this.body);
    this.choose("errors");
  }

  choose(kind) {
    this.kind = kind;
    for (const tab of this.tabs.querySelectorAll("[role=tab]")) tab.setAttribute("aria-selected", String(tab.dataset.kind === kind));
    this.shown = null;
  }

  // Which vehicles are drawn: the selected one, and the followers that are worst now.
  lines(view) {
    const { store } = this, count = store.vehicles.length;
    if (KINDS[this.kind].of === "selected") return [view.selected >= 0 ? view.selected : Math.max(0, store.vehicles.findIndex((name) => name !== store.leaderName))];
    const error = (v) => Math.hypot(...["error_x_m", "error_y_m", "error_z_m"].map((name) => store.get(v, name) || 0));
    const all = [...Array(count).keys()].filter((v) => store.vehicles[v] !== store.leaderName || Number.isFinite(store.get(v, "error_x_m")));
    if (all.length <= MAX_LINES) return all;
    const worst = [...all].sort((a, b) => error(b) - error(a)).slice(0, MAX_LINES);
    if (view.selected >= 0 && !worst.includes(view.selected)) worst[MAX_LINES - 1] = view.selected;
    return worst.sort((a, b) => a - b);
  }

  draw(view) {
    if (!this.body.clientWidth || !this.store.overview.count) return;
    const lines = this.lines(view), key = `${this.kind} ${lines} ${view.colours.dark} ${this.store.zero_s}`;
    if (this.key !== key) { this.build(lines, view); this.key = key; this.shown = null; }
    const to = this.window_s ? Math.min(this.store.last_s, Math.max(view.time_s + this.window_s / 4, this.store.first_s + this.window_s)) : this.store.last_s;
    const from = this.window_s ? Math.max(this.store.first_s, to - this.window_s) : this.store.first_s;
    const shown = `${from.toFixed(1)} ${to.toFixed(1)} ${this.store.version}`;
    if (shown !== this.shown) { this.shown = shown; this.fill(lines, from, to); }
    for (const chart of this.charts) chart.mark(view.time_s);
  }

  build(lines, view) {
    for (const { plot } of this.charts) plot.destroy();
    this.body.replaceChildren();
    const { plots } = KINDS[this.kind], zero = this.store.zero_s, { colours } = view;
    this.charts = plots.map(([label, names], place) => {
      const last = place === plots.length - 1, holder = element("div", { class: "plot" });
      const line = element("div", { class: "now" });
      this.body.append(holder);
      const series = [{}, ...lines.flatMap((v) => names.map((name, i) => ({
        label: names.length > 1 ? WORDS[name] || "setpoint" : this.store.vehicles[v],
        stroke: names.length > 1 ? [colours.ink, OKABE_ITO[4], OKABE_ITO[5], OKABE_ITO[2]][i] : colourOf(this.store, v, colours),
        width: v === view.selected && names.length === 1 ? 2.5 : 1.3, dash: name.startsWith("setpoint") ? [5, 4] : undefined, points: { show: false }, spanGaps: false,
      })))];
      const bounds = this.boundsOf(place);
      series.push(...bounds.flatMap(() => [1, -1].map(() => ({ label: "held to", stroke: colours.bad, width: 1, dash: [4, 4], points: { show: false } }))));
      const axis = { stroke: colours.ink, grid: { stroke: colours.line, width: 1 }, ticks: { stroke: colours.line }, font: font(11) };
      const plot = new uPlot({
        width: this.body.clientWidth, height: this.heightOf(plots.length, last), series, legend: { show: false }, cursor: { drag: { x: false, y: false }, points: { show: false } },
        scales: { x: { time: false }, y: { range: (_, low, high) => rangeOf(low, high) } },
        axes: [
          { ...axis, size: (last ? 32 : 8) * em(), splits: (_, i, low, high, step) => steps(low - zero, high - zero, step).map((t) => t + zero), values: (_, ticks) => ticks.map((t) => (last ? String(Math.round((t - zero) * 10) / 10) : "")) },
          { ...axis, size: 52 * em(), space: 15 * em(), label, labelSize: 16 * em(), labelFont: font(11) },
        ],
      }, [[0], ...series.slice(1).map(() => [null])], holder);
      plot.over.append(line);
      plot.over.addEventListener("click", () => { if (plot.cursor.left >= 0) this.seek(plot.posToVal(plot.cursor.left, "x")); });
      const mark = (time) => { line.style.transform = `translateX(${plot.valToPos(time, "x") || -9}px)`; };
      return { plot, names, mark, last, bounds };
    });
    this.describe(lines);
    this.resize();
  }

  // Bounds after a gust, of an axis of the errors: what they are held to.
  boundsOf(place) {
    return this.kind === "errors" ? (this.store.meta.scene.bounds || []).filter((bound) => bound.axis === "xyz"[place]) : [];
  }

  describe(lines) {
    const texts = this.charts[0].plot.series.slice(1).filter((each) => each.label !== "held to");
    this.legend.replaceChildren(...texts.map((each) => {
      const key = element("i"); key.style.background = each.stroke();
      return element("span", {}, key, KINDS[this.kind].of === "selected" ? each.label : `vehicle ${each.label}`);
    }), ...(KINDS[this.kind].of === "selected" ? [element("b", {}, `vehicle ${this.store.vehicles[lines[0]]}`)] : []));
  }

  fill(lines, from, to) {
    for (const { plot, names, bounds } of this.charts) {
      let times = null;
      const values = lines.flatMap((v) => {
        const [at, ...found] = this.store.series(v, names, from, to);
        times = times || at;
        return found.map((each, i) => { const by = scaleOf(names[i]); return names[i].endsWith("heading_rad") ? unwrapped(each, by) : each.map((value) => (value === null ? null : value * by)); });
      });
      const zero = this.store.zero_s;
      const held = bounds.flatMap((bound) => [1, -1].map((sign) => times.map((t) => (t - zero >= bound.from && t - zero <= bound.to ? sign * bound.allowed : null))));
      plot.setData([times, ...values, ...held], false);
      plot.setScale("x", { min: from, max: Math.max(to, from + 1) });
    }
  }

  heightOf(count, last) {
    const axis = 24 * em();
    return Math.max(40, Math.floor((this.body.clientHeight - axis - 2) / count)) + (last ? axis : 0);
  }

  resize() {
    for (const { plot, last } of this.charts) plot.setSize({ width: this.body.clientWidth, height: this.heightOf(this.charts.length, last) });
  }
}

function steps(low, high, step) {
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high; k++) found.push(k * step);
  return found;
}

function rangeOf(low, high) {
  if (!Number.isFinite(low) || !Number.isFinite(high)) return [-1, 1];
  const room = Math.max(0.05, (high - low) * 0.1);
  return [low - room, high + room];
}

function unwrapped(values, by) {
  let before = null;
  return values.map((value) => {
    if (value === null) return null;
    const turned = before === null ? value : value - TURN * Math.round((value - before) / TURN);
    before = turned;
    return turned * by;
  });
}
