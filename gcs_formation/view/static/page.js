// The page: one clock, one data model, and what shows it.
"use strict";
const STATES = {
  live: "live", silent: "the station writes nothing: it may be stopped", concluding: "the flight is over; its summary is being made",
  ended: "ended", killed: "the station has gone without a summary: killed, or failed", log: "a log", gone: "the viewer has gone: nothing new is shown",
};
const DETAIL_S = 60;

class Clock {
  constructor(page) {
    this.page = page;
    this.time_s = NaN;
    this.following = true;
    this.playing = true;
    this.speed = 1;
    this.rate = 1;
  }

  isLive() { return this.page.state === "live" || this.page.state === "silent"; }

  toggle() {
    const { store } = this.page;
    if (!this.playing && this.time_s >= store.last_s - 0.01 && !this.isLive()) this.time_s = store.first_s;
    this.playing = !this.playing;
    this.following = false;
  }

  seek(time_s) {
    this.following = false;
    this.time_s = Math.min(this.page.store.last_s, Math.max(this.page.store.first_s, time_s));
    this.page.wantDetail();
  }

  goLive() { this.following = true; this.playing = true; this.time_s = this.page.store.last_s; }

  advance(wall_s) {
    const { store } = this.page, last = store.last_s;
    if (!Number.isFinite(last)) return;
    if (Number.isNaN(this.time_s)) { this.time_s = this.isLive() ? last : store.first_s; this.playing = true; this.following = this.isLive(); }
    if (this.following && this.isLive()) {
      const behind = last - this.time_s, pace = Math.max(this.rate, 0.1);
      this.time_s = behind > 1.5 * pace || behind < 0 ? last : Math.min(last, this.time_s + wall_s * pace * (behind > 0.3 * pace ? 1.1 : 0.95));
    } else if (this.playing) {
      this.time_s = Math.min(last, this.time_s + wall_s * this.speed);
      if (this.time_s >= last && !this.isLive()) this.playing = false;
    }
  }

  // How fast the flight goes, by what arrives.
  arrived(last_s, wall_s) {
    if (this.before && wall_s > this.before.wall_s + 0.3) {
      const rate = (last_s - this.before.last_s) / (wall_s - this.before.wall_s);
      this.rate = 0.5 * this.rate + 0.5 * rate;
      this.before = null;
    }
    this.before = this.before || { last_s, wall_s };
  }
}

class Page {
  constructor(place, source) {
    this.place = place;
    this.source = source;
    this.clock = new Clock(this);
    this.selected = -1;
    this.nextEvent = 0;
    this.frames = 0;
    this.colours = theme();
  }

  async begin() {
    measureText();
    await this.load();
    this.build();
    if (this.source.isStatic) Object.assign(this.clock, { playing: false, following: false, time_s: this.store.zero_s || this.store.first_s });
    this.source.listen({ status: (status) => this.onStatus(status), ticks: (block) => this.onTicks(block), gone: () => this.setState("gone") });
    setInterval(() => { if (this.heard && performance.now() - this.heard > 3000) this.setState("gone"); }, 500);
    let before = performance.now();
    const frame = (now) => { this.clock.advance(Math.min(0.5, (now - before) / 1000)); before = now; this.draw(now); this.frames += 1; requestAnimationFrame(frame); };
    requestAnimationFrame(frame);
    this.place.dataset.ready = "true";
  }

  async load() {
    const meta = await this.source.meta();
    this.store = Object.assign(new Store(meta), { leaderName: meta.scene.leader, zero_s: 0 });
    this.state = meta.state;
    this.generation = meta.generation;
    const block = await this.source.ticks({ rows: 60000 });
    if (block) this.store.addOverview(block);
    this.nextEvent = 0;
    await this.readEvents();
  }

  build() {
    const { store, clock } = this, seek = (time_s) => clock.seek(time_s);
    this.place.replaceChildren();
    const part = (name, ...children) => element("section", { class: name }, ...children);
    this.badge = element("strong", { class: "state", role: "status" });
    this.title = element("h1", {}, store.meta.scene.name || "flight");
    this.phase = element("span", { class: "flight-phase" });
    const button = (text, label, action) => element("button", { type: "button", title: label, "aria-label": label, onclick: action }, text);
    const header = element("header", {}, this.title, this.badge, this.phase, element("span", { class: "grow" }), this.place.classList.contains("inside") ? "" : button(icon("theme"), "Light or dark (t)", () => this.toggleTheme()));
    this.stage = element("div", { class: "stage" });
    this.markers = element("div", { class: "markers", "aria-hidden": "true" });
    this.spaceButton = button("3D", "Plan or three dimensions (3)", () => this.toggleSpace());
    const tools = element("div", { class: "tools" }, this.spaceButton, button(icon("follow"), "Follow the formation (f)", () => this.follow()), button(icon("all"), "Show everything (a)", () => this.showAll()), button(icon("plus"), "Nearer (+)", () => this.zoom(1.4)), button(icon("minus"), "Farther (-)", () => this.zoom(1 / 1.4)));
    const view = part("view", this.stage, tools);
    const plots = part("charts"), side = part("side"), bar = element("footer", { class: "timebar" });
    this.place.append(header, view, side, plots, bar);
    this.plan = new Plan(this.stage, store);
    this.space = new Space(this.stage, store);
    this.stage.append(this.markers);
    this.plots = new Plots(plots, store, seek);
    this.bar = new TimeBar(bar, store, clock);
    this.buildSide(side, seek);
    this.labels = store.vehicles.map((name, v) => element("button", { type: "button", tabindex: "-1", class: "marker", "data-marker": name, onclick: () => this.select(v) }, name));
    this.markers.append(...this.labels);
    this.inside = this.place.classList.contains("inside"); // of a report, whose keys scroll
    if (this.inside) this.place.tabIndex = -1;
    (this.inside ? this.place : document).addEventListener("keydown", (event) => this.key(event));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.setTheme(preferredTheme()));
    this.setState(this.state);
    this.eventsChanged();
  }

  buildSide(side, seek) {
    const panels = { vehicles: "Vehicles", links: "Links", events: "Events", ...(this.source.isStatic ? {} : { orders: "Orders" }) }, tabs = element("div", { class: "tabs", role: "tablist" });
    this.panels = {};
    for (const [name, text] of Object.entries(panels)) {
      this.panels[name] = element("div", { class: "panel", role: "tabpanel", "data-panel": name });
      tabs.append(element("button", { type: "button", role: "tab", "data-tab": name, onclick: () => this.choose(name) }, text));
    }
    side.append(tabs, ...Object.values(this.panels));
    this.tabs = tabs;
    this.cards = new Cards(this.panels.vehicles, this.store, (v) => this.select(v));
    this.links = new Links(this.panels.links, this.store);
    this.events = new Events(this.panels.events, this.store, seek);
    if (this.panels.orders) this.orders = new Orders(this.panels.orders, this.store, this.source);
    this.choose("vehicles");
  }

  choose(name) {
    this.panel = name;
    for (const tab of this.tabs.children) tab.setAttribute("aria-selected", String(tab.dataset.tab === name));
    for (const [other, panel] of Object.entries(this.panels)) panel.hidden = other !== name;
  }

  select(v) { this.selected = this.selected === v ? -1 : v; }

  // What all parts draw: places, slots and distances at the clock's time.
  view() {
    const { store } = this, time_s = Number.isNaN(this.clock.time_s) ? 0 : this.clock.time_s, moment = store.at(time_s);
    const vehicles = [...store.vehicles.keys()];
    const places = vehicles.map((v) => ["north_m", "east_m", "height_m", "heading_rad", "airspeed_mps"].map((name) => store.get(v, name)));
    const slots = vehicles.map((v) => ["slot_north_m", "slot_east_m", "slot_height_m"].map((name) => store.get(v, name)));
    const known = places.filter(([north]) => Number.isFinite(north)), mean = (k) => known.reduce((sum, place) => sum + place[k], 0) / known.length;
    const centre = this.selected >= 0 && Number.isFinite(places[this.selected][0]) ? places[this.selected] : [mean(0), mean(1), mean(2)];
    const heights = known.map((place) => place[2]);
    return {
      time_s, moment, places, slots, colours: this.colours, selected: this.selected, centre: centre.slice(0, 2), height: centre[2], floor: Math.min(0, ...heights),
      pairs: this.pairs(places), yields: (v) => store.get(v, "yielding") > 0, ahead: (v, s) => this.ahead(v, places[v], time_s, s), said: (name, kind) => this.said(name, kind, time_s),
    };
  }

  // Pairs of vehicles in the air that are nearer than twice the distance that the separation rule keeps.
  pairs(places) {
    const { store } = this, scene = store.meta.scene, reach = 1.3 * (scene.avoidance_m || 0), found = [];
    if (!reach) return found;
    for (let a = 0; a < places.length; a++) {
      if (!(store.get(a, "airborne") > 0)) continue;
      for (let b = a + 1; b < places.length; b++) {
        const north = places[a][0] - places[b][0], east = places[a][1] - places[b][1];
        if (!(Math.abs(north) < reach && Math.abs(east) < reach) || !(store.get(b, "airborne") > 0)) continue;
        const distance = Math.hypot(north, east, places[a][2] - places[b][2]);
        const gives = store.get(a, "yielding") > 0 || store.get(b, "yielding") > 0;
        if (distance < reach && (distance < scene.avoidance_m || gives)) found.push({ a, b, distance, limit: scene.separation_m, gives });
      }
    }
    return found;
  }

  // Where a vehicle is in some seconds, if it goes on turning as it does.
  ahead(v, [north, east, , heading, speed], time_s, seconds) {
    const { store } = this, before = store.around(time_s - 1);
    let rate = 0;
    if (before) {
      const then = before.ticks.values[before.i * before.ticks.width + v * store.width + store.column.heading_rad], span = time_s - before.ticks.time[before.i];
      if (Number.isFinite(then) && span > 0.3 && span < 5) rate = Math.max(-0.3, Math.min(0.3, (((heading - then + 3 * Math.PI) % TURN) - Math.PI) / span));
    }
    const points = [];
    for (let s = 1; s <= seconds; s++) {
      heading += rate; north += speed * Math.cos(heading); east += speed * Math.sin(heading);
      points.push([north, east]);
    }
    return points;
  }

  // The last text of a kind about a vehicle up to a time.
  said(name, kind, time_s) {
    const list = this.texts.get(`${kind} ${name}`) || [];
    let low = 0, high = list.length;
    while (low < high) { const middle = (low + high) >> 1; if (list[middle].t_s <= time_s + 1e-6) low = middle + 1; else high = middle; }
    return low ? String(list[low - 1].text) : "";
  }

  draw(now) {
    if (!this.store) return;
    const view = this.view(), shown = this.space.visible ? this.space : this.plan;
    shown.draw(view);
    this.place.dataset.time = view.time_s.toFixed(2);
    this.drawMarkers(shown, view);
    this.bar.draw(view);
    if (!this.slowAt || now - this.slowAt > 200) {
      this.slowAt = now;
      if (this.panel === "vehicles") this.cards.draw(view);
      if (this.panel === "links") this.links.draw(view);
      this.plots.draw(view);
      say(this.phase, view.moment ? view.moment.phase : "connecting");
      this.wantDetailSoon(view.time_s);
    }
  }

  drawMarkers(shown, view) {
    const size = em(), taken = [], places = this.labels.map((_, v) => shown.project(v, view));
    const covers = ([x, y]) => ([px, py]) => px > x + 2 * size && px < x + 32 * size && py > y - 26 * size && py < y - 4 * size;
    this.labels.forEach((label, v) => {
      const at = places[v];
      const inside = at && at[0] > -20 && at[1] > -20 && at[0] < this.stage.clientWidth + 20 && at[1] < this.stage.clientHeight + 20;
      const crowded = () => taken.some(([x, y]) => Math.abs(x - at[0]) < 22 * size && Math.abs(y - at[1]) < 16 * size) || places.some((other) => other && covers(at)(other));
      const free = inside && (v === this.selected || !crowded());
      if (label.hidden === free) label.hidden = !free;
      if (!free) return;
      taken.push(at);
      label.style.transform = `translate(${at[0] + 9 * size}px, ${at[1] - 24 * size}px)`;
    });
  }

  onStatus(status) {
    this.heard = performance.now();
    if (status.generation !== this.generation) { this.generation = status.generation; this.reload(); }
    if (status.events > this.nextEvent) this.readEvents().then(() => this.eventsChanged());
    this.setState(status.state);
    if (status.failure) say(this.badge, status.failure);
  }

  onTicks(block) {
    this.heard = performance.now();
    if (block.generation !== this.generation || block.vehicles !== this.store.vehicles.length) return;
    this.store.addRecent(block);
    this.clock.arrived(this.store.last_s, performance.now() / 1000);
  }

  // Read all again: the record of a flight that has ended knows more than what was sent during it.
  async reload() {
    const block = await this.source.ticks({ rows: 60000 });
    if (!block || block.vehicles !== this.store.vehicles.length) return;
    for (const ticks of [this.store.overview, this.store.recent, this.store.detail]) ticks.clear();
    this.store.overview.step_s = 0;
    this.store.addOverview(block);
    this.detailed = null;
    this.wantDetail();
  }

  async readEvents() {
    if (this.reading) return;
    this.reading = true;
    try {
      for (;;) {
        const answer = await this.source.events(this.nextEvent);
        this.store.events.push(...answer.events);
        if (this.nextEvent === answer.next || this.store.events.length > 50000) break;
        this.nextEvent = answer.next;
      }
    } finally { this.reading = false; }
  }

  eventsChanged() {
    this.texts = new Map();
    for (const event of this.store.events) {
      if (event.kind === "phase" && event.text === "flying") this.store.zero_s = event.t_s;
      if (event.kind !== "mode" && event.kind !== "statustext") continue;
      const key = `${event.kind} ${event.vehicle}`;
      if (!this.texts.has(key)) this.texts.set(key, []);
      this.texts.get(key).push(event);
    }
    this.events.refresh();
  }

  setState(state) {
    this.state = state;
    if (!this.badge) return;
    say(this.badge, STATES[state] || state);
    this.badge.dataset.state = state;
    if (this.orders && state !== "gone") this.orders.enable(this.store.meta.orders && (state === "live" || state === "silent"));
  }

  wantDetailSoon(time_s) {
    const known = this.detailed;
    if (!known || time_s < known[0] || time_s > known[1]) this.wantDetail();
  }

  // Ask for every tick around the time that is looked at, unless it is known.
  async wantDetail() {
    const time_s = this.clock.time_s, { store } = this;
    if (this.asking || !Number.isFinite(time_s) || (this.isRecent(time_s) && this.clock.isLive())) return;
    if (this.detailed && time_s > this.detailed[0] + 1 && time_s < this.detailed[1] - 1) return;
    this.asking = true;
    try {
      const range = [time_s - DETAIL_S / 2, time_s + DETAIL_S * Math.max(1, Math.min(4, this.clock.speed))];
      const block = await this.source.ticks({ from_s: range[0], to_s: range[1] });
      if (block && block.generation === this.generation) { store.setDetail(block); this.detailed = range; }
    } catch (error) {
      this.detailed = [time_s - 1, time_s + 5]; // the viewer has gone: what is known is shown
    } finally { this.asking = false; }
  }

  isRecent(time_s) { return this.store.recent.count > 0 && time_s >= this.store.recent.first_s; }

  async toggleSpace() {
    const on = !this.space.visible, could = await this.space.show(on);
    if (on && !could) { this.spaceButton.disabled = true; this.spaceButton.title = "This browser has no WebGL"; return; }
    this.plan.show(!on);
    this.spaceButton.setAttribute("aria-pressed", String(on));
  }

  follow() {
    const { places } = this.view();
    if (this.space.visible) this.space.fitFormation(places); else this.plan.fitFormation(places);
  }

  showAll() {
    if (this.space.visible) { this.space.following = false; this.space.zoom(0.2); } else this.plan.fitAll(this.view().places);
  }

  zoom(factor) { if (this.space.visible) this.space.zoom(factor); else this.plan.camera.zoom(factor); }

  toggleTheme() { this.setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"); }

  setTheme(name) {
    document.documentElement.dataset.theme = name;
    this.colours = theme();
  }

  key(event) {
    if (/^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName) && event.target.type !== "range" || event.ctrlKey || event.metaKey || event.altKey) return;
    const steps = { ArrowLeft: -1, ArrowRight: 1, PageUp: -10, PageDown: 10 };
    const keys = {
      " ": () => this.clock.toggle(), l: () => this.clock.goLive(), f: () => this.follow(), a: () => this.showAll(), 3: () => this.toggleSpace(), t: () => this.toggleTheme(),
      "+": () => this.zoom(1.4), "=": () => this.zoom(1.4), "-": () => this.zoom(1 / 1.4), ",": () => this.bar.jump(-1), ".": () => this.bar.jump(1),
      Home: () => this.clock.seek(this.store.first_s), End: () => this.clock.seek(this.store.last_s),
    };
    if (event.key in steps) this.clock.seek(this.clock.time_s + steps[event.key]);
    else if (event.key in keys && !(event.key === " " && event.target.tagName === "BUTTON")) keys[event.key]();
    else return;
    event.preventDefault();
  }
}

const preferredTheme = () => (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");

function beginView() {
  const place = document.getElementById("viewer"), given = document.getElementById("recording");
  document.documentElement.dataset.theme = preferredTheme();
  const page = new Page(place, given ? new StaticSource(JSON.parse(given.textContent)) : new ServerSource());
  window.gcsView = page;
  page.begin().catch((error) => { place.textContent = `the page couldn't begin: ${error.message}`; });
}
beginView();
