// Orders to the flight, as `tell` has them, and links of a `run`: what would be refused is said before it is sent.
"use strict";
const SHAPES = ["follower", "diamond", "triangle", "square", "plus", "arrow", "line", "echelon", "circle"];

class Orders {
  constructor(place, store, source) {
    this.store = store;
    this.source = source;
    this.place = place;
    const scene = store.meta.scene;
    this.line = element("input", { type: "text", maxlength: "100", list: "orders", placeholder: "shape line 40", "aria-label": "Order", autocomplete: "off", oninput: () => this.checkSoon() });
    const known = [...SHAPES.map((shape) => `shape ${shape}`), `spacing ${scene.spacing_m ?? 40}`, `speed ${scene.speed_mps ?? 22}`, ...store.vehicles.slice(0, 20).map((name) => `leader ${name}`), "loiter", "rtl", "land"];
    const list = element("datalist", { id: "orders" }, ...known.map((value) => element("option", { value })));
    this.verdict = element("p", { class: "verdict", role: "status" });
    const form = element("form", { class: "order", onsubmit: (event) => { event.preventDefault(); this.send(this.line.value); } }, this.line, list, element("button", { type: "submit" }, "Send"));
    const quick = (text) => element("button", { type: "button", onclick: () => this.pick(text) }, text);
    const shapes = element("div", { class: "quick" }, ...SHAPES.map((shape) => quick(`shape ${shape}`)));
    const ends = element("div", { class: "quick ends" }, ...["loiter", "rtl", "land"].map(quick));
    this.log = element("ol", { class: "answers" });
    this.dialog = element("dialog", { class: "confirm" });
    this.off = element("p", { class: "note" }, "No flight here takes orders.");
    this.on = element("div", {}, form, this.verdict, shapes, ends, this.linkForm(), this.log, this.dialog);
    place.append(this.off, this.on);
    this.enable(store.meta.orders);
  }

  enable(on) { this.on.hidden = !on; this.off.hidden = on; }

  pick(text) { this.line.value = text; this.line.focus(); this.check(); }

  checkSoon() { clearTimeout(this.waiting); this.waiting = setTimeout(() => this.check(), 600); }

  async check() {
    const order = this.line.value.trim();
    if (!order) { this.verdict.textContent = ""; return; }
    const answer = await this.considered(order);
    if (order !== this.line.value.trim()) return;
    this.verdict.textContent = answer.text;
    this.verdict.className = `verdict ${answer.accepted ? "good" : "bad"}`;
  }

  // What the flight would answer; asked once, since it plans the change as if it were ordered.
  async considered(order) {
    if (this.known && this.known.order === order && performance.now() - this.known.at < 5000) return this.known.answer;
    this.known = { order, at: performance.now(), answer: this.ask("api/order", { order, check: true }) };
    return this.known.answer;
  }

  async send(text) {
    const order = text.trim();
    if (!order) return;
    clearTimeout(this.waiting);
    const would = await this.considered(order);
    if (!would.accepted) { this.tell(would); return; }
    if (would.ends && !(await this.confirmed(`“${order}” ends the flight of ${this.store.meta.scene.name}. Send it?`))) return;
    this.known = null;
    this.tell(await this.ask("api/order", { order }));
  }

  tell(answer) {
    this.verdict.textContent = answer.text;
    this.verdict.className = `verdict ${answer.accepted ? "good" : "bad"}`;
    this.log.prepend(element("li", { class: answer.accepted ? "good" : "bad" }, answer.text));
    while (this.log.children.length > 20) this.log.lastChild.remove();
  }

  async ask(path, body) {
    try {
      const answer = await this.source.json(path, body);
      return { ...answer, text: answer.text || answer.error || "", accepted: Boolean(answer.accepted) };
    } catch (error) {
      return { accepted: false, text: "the viewer doesn't answer" };
    }
  }

  confirmed(question) {
    return new Promise((resolve) => {
      const close = (answer) => { this.dialog.close(); resolve(answer); };
      const no = element("button", { type: "button", onclick: () => close(false) }, "Cancel");
      const yes = element("button", { type: "button", class: "danger", "data-confirm": true, onclick: () => close(true) }, "End the flight");
      this.dialog.replaceChildren(element("p", {}, question), element("div", { class: "quick" }, no, yes));
      this.dialog.oncancel = () => resolve(false);
      this.dialog.showModal();
      no.focus();
    });
  }

  linkForm() {
    const field = (name, label, more = {}) => element("label", {}, `${label} `, element("input", { type: "number", name, min: "0", step: "any", ...more }));
    const whose = element("select", { name: "vehicles", "aria-label": "Whose link" }, element("option", { value: "all" }, "all"), ...this.store.vehicles.map((name) => element("option", { value: name }, `vehicle ${name}`)));
    const form = element("form", { class: "impair" }, element("b", {}, "Impair links"), whose, field("delay_ms", "delay, ms"), field("jitter_ms", "jitter, ms"), field("loss", "loss, %", { max: "100" }), element("button", { type: "submit" }, "Apply"));
    form.addEventListener("submit", async (event) => {
      event.preventDefault();
      const given = new FormData(form), keys = {};
      const id = (name) => (/^\d+$/.test(name) ? Number(name) : name);
      keys.vehicles = given.get("vehicles") === "all" ? "all" : [id(given.get("vehicles"))];
      for (const name of ["delay_ms", "jitter_ms", "loss"]) if (given.get(name) !== "") keys[name] = Number(given.get(name)) / (name === "loss" ? 100 : 1);
      const answer = await this.ask("api/link", keys), whose = keys.vehicles === "all" ? "all" : keys.vehicles[0];
      const given_keys = Object.entries(keys).filter(([name]) => name !== "vehicles").map(([name, value]) => `${name} ${value}`).join(", ");
      this.tell({ ...answer, text: `links of ${whose}, ${given_keys || "nothing given"}: ${answer.text}` });
    });
    return form;
  }
}
