// Common parts of all plots: a sharp canvas, the page's colours, ticks, interpolation, and the vehicles' places.

const FONT = "12px system-ui, sans-serif";

// A canvas that draws the data by the page's state.
class View {
  constructor(canvas, data, state) {
    [this.canvas, this.data, this.state] = [canvas, data, state];
    this.drag = null;
  }

  // Draws at the next frame, once for all calls until then.
  draw() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => { this.pending = false; this.paint(); });
  }
}

function prepare(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.font = FONT;
  pen.lineJoin = "round";
  return { pen, width, height };
}

function theme() {
  const style = getComputedStyle(document.documentElement);
  const read = (name) => style.getPropertyValue(name).trim();
  return {
    ink: read("--ink"), soft: read("--soft"), line: read("--line"), grid: read("--grid"),
    accent: read("--accent"), path: read("--path"), card: read("--card"),
  };
}

function ticks(low, high, wanted) {
  const rough = (high - low) / Math.max(wanted, 1);
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= rough);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + step * 1e-9; k += 1) {
    found.push({ value: k * step, text: signed(k * step, digits) });
  }
  return found;
}

// Ticks of a distance in m, with its unit.
function distances(low, high, wanted) {
  const [unit, name] = high - low < 4000 ? [1, "m"] : [1000, "km"];
  return ticks(low / unit, high / unit, wanted).map(({ value, text }) => ({ value: value * unit, text: `${text} ${name}` }));
}

function signed(value, digits) {
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "\u2212");
}

// The index of the last of ascending times that isn't after t; 0 if all are.
function before(times, t) {
  let low = 0;
  let high = times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= t) low = middle;
    else high = middle - 1;
  }
  return low;
}

function between(times, values, t) {
  const i = before(times, t);
  const j = Math.min(i + 1, times.length - 1);
  if (values[i] === null || values[j] === null || i === j) return values[i];
  const share = Math.min(1, Math.max(0, (t - times[i]) / (times[j] - times[i])));
  return values[i] + share * (values[j] - values[i]);
}

function known(values) {
  return values.filter((value) => value !== null);
}

// Least and greatest of values; -1 and 1 if there are none.
function extent(values) {
  let [low, high] = [Infinity, -Infinity];
  for (const value of values) [low, high] = [Math.min(low, value), Math.max(high, value)];
  return low > high ? [-1, 1] : [low, high];
}

// All vehicles' places at a time; null where unknown.
function placesAt(tracks, t) {
  return tracks.vehicles.map((track) => {
    const found = {};
    for (const name of Object.keys(track)) found[name] = between(tracks.t, track[name], t);
    return found.north === null || found.east === null ? null : found;
  });
}

// The text on the vehicle nearest to a point of a canvas, none if all are far; `at` projects a place onto it.
function nearest(data, state, at, x, y) {
  let best = { distance: 18 };
  placesAt(data.tracks, state.time).forEach((found, i) => {
    if (!found || state.hidden.has(i)) return;
    const on = at(found);
    const distance = Math.hypot(on.x - x, on.y - y);
    if (distance < best.distance) best = { distance, found, i };
  });
  if (!best.found) return "";
  const { name, role } = data.vehicles[best.i];
  const metres = (value) => (value === null ? "\u2013" : `${signed(value, 1)} m`);
  const { north, east, height } = best.found;
  return `${role} ${name}\nnorth ${metres(north)}\neast ${metres(east)}\nheight ${metres(height)}`;
}

function place(event, canvas) {
  const box = canvas.getBoundingClientRect();
  return { x: event.clientX - box.left, y: event.clientY - box.top };
}

function showTooltip(event, text) {
  const tip = document.getElementById("tooltip");
  tip.textContent = text;
  tip.hidden = text === "";
  if (tip.hidden) return;
  const box = tip.getBoundingClientRect();
  const left = event.clientX + 16 + box.width > window.innerWidth ? event.clientX - 16 - box.width : event.clientX + 16;
  tip.style.left = `${Math.max(0, left)}px`;
  tip.style.top = `${Math.max(0, Math.min(event.clientY + 16, window.innerHeight - box.height - 4))}px`;
}
