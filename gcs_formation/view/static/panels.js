// Vehicles' cards, links as bars, and events.
"use strict";
const MOST_SHOWN = 300;
const LIMITS = { delay: 1000, loss: 0.2, age: 2, rate: 60 }; // where bars end, unless a value is beyond

class Cards {
  constructor(place, store, select) {
    this.store = store;
    this.list = element("ul", { class: "cards" });
    place.append(this.list);
    this.cards = store.vehicles.map((name, v) => {
      const part = (kind) => element("span", { class: kind });
      const parts = Object.fromEntries(["mode", "armed", "phase", "speed", "place", "error", "battery", "text"].map((kind) => [kind, part(kind)]));
      const key = element("i", { class: "key" });
      const head = element("button", { type: "button", class: "head", "aria-pressed": "false", onclick: () => select(v) }, key, element("b", {}, `Vehicle ${name}`), parts.mode, parts.armed);
      const card = element("li", { class: "card", "data-vehicle": name }, head, element("div", { class: "row" }, parts.phase, parts.speed, parts.battery), element("div", { class: "row" }, parts.place), element("div", { class: "row" }, parts.error), parts.text);
      this.list.append(card);
      return { card, head, key, parts };
    });
  }

  draw(view) {
    const { store } = this;
    this.cards.forEach(({ card, head, key, parts }, v) => {
      const get = (name) => store.get(v, name), name = store.vehicles[v], armed = get("armed"), battery = get("battery");
      key.style.background = colourOf(store, v, view.colours);
      head.setAttribute("aria-pressed", String(v === view.selected));
      card.classList.toggle("selected", v === view.selected);
      say(parts.mode, view.said(name, "mode") || "no mode yet");
      say(parts.armed, armed > 0 ? "armed" : armed === 0 ? "disarmed" : "");
      say(parts.phase, get("leads") > 0 ? "leads" : get("yielding") > 0 ? "gives way" : get("active") > 0 ? "follows" : get("airborne") > 0 ? "in the air" : "not commanded");
      say(parts.speed, number(get("airspeed_mps"), 1, " m/s"));
      say(parts.battery, Number.isFinite(battery) ? `battery ${number(100 * battery, 0)} %` : "");
      say(parts.place, `N ${number(get("north_m"), 1)} E ${number(get("east_m"), 1)} height ${number(get("height_m"), 1)} m, ${number(degrees(get("heading_rad")), 0)}°`);
      say(parts.error, Number.isFinite(get("error_x_m")) ? `error ${["x", "y", "z"].map((axis) => `${axis} ${number(get(`error_${axis}_m`), 2)}`).join("  ")} m` : "");
      say(parts.text, view.said(name, "statustext") || "");
    });
  }
}

class Links {
  constructor(place, store) {
    this.store = store;
    const heads = ["", "up / down, ms", "jitter, ms", "loss, %", "age, ms", "kbit/s down / up", "margin used"];
    this.body = element("tbody");
    place.append(element("div", { class: "scroll" }, element("table", { class: "links" }, element("thead", {}, element("tr", {}, ...heads.map((text) => element("th", { scope: "col" }, text)))), this.body)));
    this.rows = store.vehicles.map((name) => {
      const cells = heads.map((_, i) => {
        if (!i) return { cell: element("th", { scope: "row" }, name) };
        const text = element("span"), fill = element("i"), bar = element("div", { class: "bar" }, fill);
        return { cell: element("td", {}, text, bar), text, fill, bar };
      });
      this.body.append(element("tr", {}, ...cells.map((each) => each.cell)));
      return cells;
    });
    place.append(element("p", { class: "note" }, `Bars end at ${LIMITS.delay} ms, ${100 * LIMITS.loss} %, ${LIMITS.age} s and ${LIMITS.rate} kbit/s; those of the margin at all of it, beyond which the loop is unstable${store.meta.scene.delay_margin_s ? ` (${number(1e3 * store.meta.scene.delay_margin_s, 0)} ms of delay in the slowest loop)` : ""}.`));
  }

  draw() {
    this.rows.forEach((cells, v) => {
      const get = (name) => this.store.get(v, name), up = get("up_s"), down = get("down_s"), delay = get("delay_s");
      const split = Number.isFinite(up) && Number.isFinite(down);
      this.set(cells[1], split ? `${number(1e3 * up, 0)} / ${number(1e3 * down, 0)}` : `${number(1e3 * delay, 0)} each`, (1e3 * (split ? Math.max(up, down) : delay)) / LIMITS.delay);
      this.set(cells[2], number(1e3 * get("jitter_s"), 1), get("jitter_s") * 1e3 / LIMITS.delay);
      this.set(cells[3], number(100 * get("loss"), 1), get("loss") / LIMITS.loss);
      this.set(cells[4], number(1e3 * get("age_s"), 0), get("age_s") / LIMITS.age);
      this.set(cells[5], `${number(get("rate_down_kbps"), 1)} / ${number(get("rate_up_kbps"), 1)}`, get("rate_down_kbps") / LIMITS.rate);
      this.set(cells[6], Number.isFinite(get("margin_used")) ? `${number(100 * get("margin_used"), 0)} %` : "–", get("margin_used"));
    });
  }

  set({ text, fill, bar }, words, share) {
    say(text, words);
    fill.style.width = `${100 * Math.max(0, Math.min(1, Number.isFinite(share) ? share : 0))}%`;
    bar.classList.toggle("high", share > 0.7);
    bar.classList.toggle("over", share >= 1);
  }
}

class Events {
  constructor(place, store, seek) {
    this.store = store;
    this.seek = seek;
    this.text = element("input", { type: "search", placeholder: "filter by text", "aria-label": "Filter events by text", oninput: () => this.refresh() });
    this.kind = element("select", { "aria-label": "Kind of event", onchange: () => this.refresh() }, element("option", { value: "" }, "all kinds"));
    this.vehicle = element("select", { "aria-label": "Vehicle", onchange: () => this.refresh() }, element("option", { value: "" }, "all vehicles"), ...store.vehicles.map((name) => element("option", { value: name }, `vehicle ${name}`)));
    this.list = element("ol", { class: "events" });
    this.count = element("p", { class: "note" });
    this.kinds = new Set();
    place.append(element("div", { class: "filters" }, this.text, this.kind, this.vehicle), this.list, this.count);
  }

  refresh() {
    for (const event of this.store.events) {
      if (this.kinds.has(event.kind) || this.kinds.size > 100) continue;
      this.kinds.add(event.kind);
      this.kind.append(element("option", { value: event.kind }, String(event.kind)));
    }
    const wanted = this.text.value.toLowerCase();
    const found = this.store.events.filter((event) => (!this.kind.value || event.kind === this.kind.value) && (!this.vehicle.value || String(event.vehicle) === this.vehicle.value)
      && (!wanted || `${event.kind} ${event.text} ${event.vehicle ?? ""}`.toLowerCase().includes(wanted)));
    this.list.replaceChildren(...found.slice(-MOST_SHOWN).reverse().map((event) => {
      const whose = event.vehicle === undefined ? "" : `vehicle ${event.vehicle}, `;
      const button = element("button", { type: "button", onclick: () => this.seek(event.t_s) }, element("time", {}, this.at(event.t_s)), element("span", {}, `${whose}${String(event.kind).replaceAll("_", " ")}: ${event.text}`));
      return element("li", { class: event.kind === "failure" || event.accepted === false ? "bad" : "" }, button);
    }));
    say(this.count, found.length > MOST_SHOWN ? `the last ${MOST_SHOWN} of ${found.length}` : `${found.length} events`);
  }

  at(time_s) {
    const mission = time_s - this.store.zero_s;
    return this.store.zero_s ? `${number(mission, 1)} s` : `${number(time_s, 1)} s`;
  }
}
