// The page: one clock, one data model, and what shows it.
"use strict";
const STATES = {
  live: "live", silent: "the station writes nothing: it may be stopped", concluding: "the flight is over; its summary is being made",
  ended: "ended", killed: "the station has gone without a summary: killed, or failed", log: "a log", gone: "the viewer has gone: nothing new is shown",
};
const DETAIL_S = 60;
const GONE_MS = 2500; // the viewer says something every second

class Page {
  constructor(place, source) {
    this.place = place;
    this.source = source;
    this.clock = new Clock(this);
    this.selected = -1;
    this.nextEvent = 0;
    this.frames = 0;
    this.colours = theme();
    this.texts = new Texts();
  }

  async begin() {
    measureText();
    await this.load();
    this.build();
    if (this.source.isStatic) Object.assign(this.clock, { playing: false, following: false, time_s: this.store.zero_s || this.store.first_s });
    this.source.listen({ status: (status) => this.onStatus(status), ticks: (block) => this.onTicks(block), gone: () => this.setState("gone") });
    setInterval(() => { if (this.heard && performance.now() - this.heard > GONE_MS) this.setState("gone"); }, 250);
    let before = performance.now();
    const frame = (now) => { this.clock.advance(Math.min(0.5, (now - before) / 1000)); before = now; this.draw(now); this.frames += 1; requestAnimationFrame(frame); };
    requestAnimationFrame(frame);
    this.place.dataset.ready = "true";
  }

  async load() {
    const meta = await this.source.meta();
    this.store = Object.assign(new Store(meta), { leaderName: meta.scene.leader, zero_s: 0 });
    this.picture = new Picture(this.store, this.texts);
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
    this.spaceButton = button("3D", "Plan or three dimensions (3)", () => this.toggleSpace());
    const tools = element("div", { class: "tools" }, this.spaceButton, button(icon("follow"), "Follow the formation (f)", () => this.follow()), button(icon("all"), "Show everything (a)", () => this.showAll()), button(icon("plus"), "Nearer (+)", () => this.zoom(1.4)), button(icon("minus"), "Farther (-)", () => this.zoom(1 / 1.4)));
    const view = part("view", this.stage, tools);
    const plots = part("charts"), side = part("side"), bar = element("footer", { class: "timebar" });
    this.place.append(header, view, side, plots, bar);
    this.plan = new Plan(this.stage, store);
    this.space = new Space(this.stage, store);
    this.markers = new Markers(this.stage, store, (v) => this.select(v));
    this.plots = new Plots(plots, store, seek);
    this.bar = new TimeBar(bar, store, clock);
    this.buildSide(side, seek);
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

  view() { return this.picture.at(Number.isNaN(this.clock.time_s) ? 0 : this.clock.time_s, this.selected, this.colours); }

  draw(now) {
    if (!this.store) return;
    const view = this.view(), shown = this.space.visible ? this.space : this.plan;
    shown.draw(view);
    this.place.dataset.time = view.time_s.toFixed(2);
    this.markers.draw(shown, view);
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
    const began = this.store.events.findLast((event) => event.kind === "phase" && event.text === "flying");
    if (began) this.store.zero_s = began.t_s;
    this.texts.read(this.store.events);
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
