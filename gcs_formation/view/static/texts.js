// What events say about a vehicle up to a time: its mode, its last text, what of its telemetry isn't believed.
"use strict";
class Texts {
  constructor() { this.read([]); }

  read(events) {
    this.lists = new Map();
    for (const event of events) {
      if (!["mode", "statustext", "health"].includes(event.kind)) continue;
      const key = `${event.kind} ${event.vehicle}`;
      if (!this.lists.has(key)) this.lists.set(key, []);
      this.lists.get(key).push(event);
    }
  }

  // The events of a kind about a vehicle: all of them, and how many there were up to a time.
  upTo(name, kind, time_s) {
    const list = this.lists.get(`${kind} ${name}`) || [];
    let low = 0, high = list.length;
    while (low < high) { const middle = (low + high) >> 1; if (list[middle].t_s <= time_s + 1e-6) low = middle + 1; else high = middle; }
    return [list, low];
  }

  last(name, kind, time_s) {
    const [list, count] = this.upTo(name, kind, time_s);
    return count ? String(list[count - 1].text) : "";
  }

  // Quantities of a vehicle's telemetry that aren't believed at a time.
  doubted(name, time_s) {
    const [list, count] = this.upTo(name, "health", time_s), found = new Set();
    for (let i = 0; i < count; i++) {
      const quantity = String(list[i].quantity ?? "telemetry");
      if (list[i].healthy) found.delete(quantity); else found.add(quantity);
    }
    return [...found];
  }
}
