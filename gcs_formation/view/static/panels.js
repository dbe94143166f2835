// Vehicles' cards, and events.
"use strict";
const MAX_SHOWN = 300;

class Cards {
  constructor(place, store, select) {
    this.store = store;
    this.list = element("ul", { class: "cards" });
    place.append(this.list);
    this.cards = store.vehicles.map((name, v) => {
      const part = (kind) => element("span", { class: kind });
      const parts = Object.fromEntries(["mode", "armed", "phase", "speed", "place", "error", "battery", "doubt", "text"].map((kind) => [kind, part(kind)]));
      const key = element("i", { class: "key" });
      const head = element("button", { type: "button", class: "head", "aria-pressed": "false", onclick: () => select(v) }, key, element("b", {}, `Vehicle ${name}`), parts.mode, parts.armed);
      const card = element("li", { class: "card", "data-vehicle": name }, head, element("div", { class: "row" }, parts.phase, parts.speed, parts.battery), element("div", { class: "row" }, parts.place), element("div", { class: "row" }, parts.error), parts.doubt, parts.text);
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
      say(parts.phase, get("leads") > 0 ? "leads" : get("yielding") > 0 ? "avoids" : get("active") > 0 ? "follows" : get("airborne") > 0 ? "in the air" : "not commanded");
      say(parts.speed, number(get("airspeed_mps"), 1, " m/s"));
      say(parts.battery, Number.isFinite(battery) ? `battery ${number(100 * battery, 0)} %` : "");
      say(parts.place, `N ${number(get("north_m"), 1)} E ${number(get("east_m"), 1)} height ${number(get("height_m"), 1)} m, ${number(degrees(get("heading_rad")), 0)}°`);
      say(parts.error, Number.isFinite(get("error_x_m")) ? `error ${["x", "y", "z"].map((axis) => `${axis} ${number(get(`error_${axis}_m`), 2)}`).join("  ")} m` : "");
      const doubted = view.doubted(name);
      say(parts.doubt, doubted.length ? `⚠ telemetry not believed: ${doubted.join(", ")}` : "");
      card.classList.toggle("doubted", doubted.length > 0);
      say(parts.text, view.said(name, "statustext") || "");
    });
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
    this.list.replaceChildren(...found.slice(-MAX_SHOWN).reverse().map((event) => {
      const whose = event.vehicle === undefined ? "" : `vehicle ${event.vehicle}, `;
      const button = element("button", { type: "button", onclick: () => this.seek(event.t_s) }, element("time", {}, this.at(event.t_s)), element("span", {}, `${whose}${String(event.kind).replaceAll("_", " ")}: ${event.text}`));
      return element("li", { class: event.kind === "failure" || event.accepted === false ? "bad" : "" }, button);
    }));
    say(this.count, found.length > MAX_SHOWN ? `the last ${MAX_SHOWN} of ${found.length}` : `${found.length} events`);
  }

  at(time_s) {
    const mission = time_s - this.store.zero_s;
    return this.store.zero_s ? `${number(mission, 1)} s` : `${number(time_s, 1)} s`;
  }
}
