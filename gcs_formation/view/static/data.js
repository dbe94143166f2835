// The data of a flight: ticks of numbers as the server packs them, and what is shown at a time.
"use strict";
const ANGLES = ["heading_rad", "setpoint_heading_rad"];
const FLAGS = ["active", "leads", "yielding", "airborne", "armed"];
const TURN = 2 * Math.PI;

// Ticks in order of time, at most `capacity`: then every second one is left out, so that memory stays the same.
class Ticks {
  constructor(vehicles, columns, capacity, thin) {
    this.width = vehicles * columns;
    this.capacity = capacity;
    this.thin = thin;
    this.step_s = 0;
    this.clear();
  }

  clear() {
    this.count = 0;
    this.time = new Float64Array(64);
    this.mission = new Float64Array(64);
    this.phase = new Float64Array(64);
    this.values = new Float32Array(64 * this.width);
  }

  get last_s() { return this.count ? this.time[this.count - 1] : NaN; }

  get first_s() { return this.count ? this.time[0] : NaN; }

  add(block, index) {
    const time = block.time[index];
    if (this.count && time < this.last_s + Math.max(this.step_s, 1e-9)) return;
    if (this.count === this.capacity) this.makeRoom();
    if (this.count === this.time.length) this.grow();
    this.time[this.count] = time;
    this.mission[this.count] = block.mission[index];
    this.phase[this.count] = block.phase[index];
    this.values.set(block.values.subarray(index * this.width, (index + 1) * this.width), this.count * this.width);
    this.count += 1;
  }

  grow() {
    const size = Math.min(this.capacity, 2 * this.time.length);
    for (const name of ["time", "mission", "phase", "values"]) {
      const old = this[name];
      this[name] = new old.constructor(name === "values" ? size * this.width : size);
      this[name].set(old);
    }
  }

  makeRoom() {
    const w = this.width, half = this.count >> 1;
    if (this.thin) {
      for (let i = 0; i < half; i++) this.copy(2 * i, i);
      this.step_s = (this.time[half - 1] - this.time[0]) / (half - 1) * 0.999;
    } else {
      for (const name of ["time", "mission", "phase"]) this[name].copyWithin(0, this.count - half, this.count);
      this.values.copyWithin(0, (this.count - half) * w, this.count * w);
    }
    this.count = half;
  }

  copy(from, to) {
    for (const name of ["time", "mission", "phase"]) this[name][to] = this[name][from];
    this.values.copyWithin(to * this.width, from * this.width, (from + 1) * this.width);
  }

  // Index of the last tick up to a time, -1 before the first.
  before(time_s) {
    let low = 0, high = this.count;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.time[middle] <= time_s) low = middle + 1; else high = middle;
    }
    return low - 1;
  }
}

function unpack(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const three = new Float64Array(buffer, 4 + length, 3 * head.count);
  const pick = (place) => Float64Array.from({ length: head.count }, (_, i) => three[3 * i + place]);
  const values = new Float32Array(buffer, 4 + length + 24 * head.count, head.count * head.vehicles * head.columns);
  return { ...head, time: pick(0), mission: pick(1), phase: pick(2), values };
}

function bytesOf(base64) {
  return Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0)).buffer;
}

// What is known of the flight here: thinned out from end to end, and whole where somebody looks.
class Store {
  constructor(meta) {
    this.meta = meta;
    this.vehicles = meta.vehicles;
    this.column = Object.fromEntries(meta.columns.map((name, index) => [name, index]));
    this.width = meta.columns.length;
    const rows = (most) => Math.max(64, Math.floor(most / Math.max(1, this.vehicles.length)));
    this.overview = new Ticks(this.vehicles.length, this.width, rows(60000), true);
    this.recent = new Ticks(this.vehicles.length, this.width, rows(40000), false);
    this.detail = new Ticks(this.vehicles.length, this.width, rows(40000), false);
    this.events = [];
    this.row = new Float32Array(this.vehicles.length * this.width);
    this.angle = this.flags(ANGLES);
    this.flag = this.flags(FLAGS);
    this.version = 0;
  }

  flags(names) {
    const found = new Uint8Array(this.width);
    for (const name of names) if (name in this.column) found[this.column[name]] = 1;
    return found;
  }

  addOverview(block) { for (let i = 0; i < block.count; i++) this.overview.add(block, i); this.version += 1; }

  addRecent(block) {
    for (let i = 0; i < block.count; i++) { this.recent.add(block, i); this.overview.add(block, i); }
    this.version += 1;
  }

  setDetail(block) {
    this.detail.clear();
    for (let i = 0; i < block.count; i++) this.detail.add(block, i);
    this.version += 1;
  }

  get first_s() { return this.overview.first_s; }

  get last_s() {
    const last = Math.max(this.overview.count ? this.overview.last_s : -Infinity, this.recent.count ? this.recent.last_s : -Infinity);
    return Number.isFinite(last) ? last : NaN;
  }

  // The ticks around a time that are nearest to each other, and their indices.
  around(time_s) {
    let best = null, gap = Infinity;
    for (const ticks of [this.detail, this.recent, this.overview]) {
      if (!ticks.count) continue;
      const i = Math.max(0, ticks.before(time_s)), j = Math.min(i + 1, ticks.count - 1);
      if (ticks.time[i] > time_s + 1e-6 && ticks !== this.overview) continue;
      const inside = ticks.time[j] >= time_s - 1e-6;
      const wide = inside ? ticks.time[j] - ticks.time[i] : 1e6 + time_s - ticks.time[j];
      if (wide < gap) { best = { ticks, i, j }; gap = wide; }
    }
    return best;
  }

  // The values of all vehicles at a time, between two ticks: this.row, and {time, mission, phase}.
  at(time_s) {
    const found = this.around(time_s);
    if (!found) { this.row.fill(NaN); return null; }
    const { ticks, i, j } = found, w = ticks.width, columns = this.width;
    const span = ticks.time[j] - ticks.time[i];
    const share = span > 0 && span < 30 ? Math.min(1, Math.max(0, (time_s - ticks.time[i]) / span)) : 0;
    const a = ticks.values.subarray(i * w, (i + 1) * w), b = ticks.values.subarray(j * w, (j + 1) * w);
    for (let k = 0; k < w; k++) {
      const column = k % columns;
      if (share === 0 || this.flag[column]) { this.row[k] = a[k]; continue; }
      let change = b[k] - a[k];
      if (this.angle[column]) change -= TURN * Math.round(change / TURN);
      this.row[k] = Number.isNaN(change) ? a[k] : a[k] + share * change;
    }
    const step = Number.isNaN(ticks.mission[i]) ? 0 : time_s - ticks.time[i];
    return { time: time_s, mission: ticks.mission[i] + step, phase: this.meta.phases[ticks.phase[i]] || "" };
  }

  get(vehicle, name) { return this.row[vehicle * this.width + this.column[name]]; }

  // Times and values of some columns between two times, of the ticks that know them best.
  series(vehicle, names, from_s, to_s) {
    const narrow = [this.detail, this.recent].find((t) => t.count > 1 && t.first_s <= from_s + 1 && t.last_s >= Math.min(to_s, this.last_s) - 1);
    const ticks = narrow || this.overview;
    const begin = Math.max(0, ticks.before(from_s)), end = Math.min(ticks.count, ticks.before(to_s) + 2);
    const every = Math.max(1, Math.floor((end - begin) / 900)), times = [], found = names.map(() => []);
    for (let i = begin; i < end; i += every) {
      times.push(ticks.time[i]);
      names.forEach((name, at) => {
        const value = ticks.values[i * ticks.width + vehicle * this.width + this.column[name]];
        found[at].push(Number.isFinite(value) ? value : null);
      });
    }
    return [times, ...found];
  }
}

// Asks the server, and listens to it.
class ServerSource {
  async json(path, body) {
    const options = body === undefined ? {} : { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) };
    const answer = await fetch(path, options);
    return answer.json();
  }

  meta() { return this.json("api/meta"); }

  async ticks(query) {
    const answer = await fetch(`api/ticks?${new URLSearchParams(query)}`);
    if (!answer.ok) throw new Error(`found ${answer.status} instead of ticks`);
    return unpack(await answer.arrayBuffer());
  }

  events(after) { return this.json(`api/events?after=${after}`); }

  listen(on) {
    this.stream = new EventSource("api/stream");
    this.stream.addEventListener("status", (message) => on.status(JSON.parse(message.data)));
    this.stream.addEventListener("ticks", (message) => on.ticks(unpack(bytesOf(message.data))));
    this.stream.addEventListener("bye", () => { this.stream.close(); on.gone(); });
    this.stream.onerror = () => on.gone();
  }
}

// The same from an element of the page itself, for a file that needs no server.
class StaticSource {
  constructor(given) { this.given = given; this.isStatic = true; }

  async meta() { return { ...this.given.meta, orders: false }; }

  async ticks(query) { return query.rows ? unpack(bytesOf(this.given.ticks)) : null; }

  async events(after) { return { events: after ? [] : this.given.events, next: this.given.events.length }; }

  listen() {}
}
