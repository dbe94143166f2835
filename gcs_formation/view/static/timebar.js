// The time slider: play, speed, jump to an event, back to live.
"use strict";
const SPEEDS = [0.25, 0.5, 1, 2, 5, 10, 30];
const JUMPED = ["phase", "formation", "leader", "order", "failure", "fault", "separation", "link", "script", "statustext"];
const STEPS = 10000;

class TimeBar {
  constructor(place, store, clock) {
    this.store = store;
    this.clock = clock;
    const button = (name, label, action) => element("button", { type: "button", class: name, "aria-label": label, title: label, onclick: action });
    this.play = button("play", "Play or pause (space)", () => clock.toggle());
    this.live = element("button", { type: "button", class: "live", title: "Follow the flight (l)", onclick: () => clock.goLive() }, "live");
    const back = button("back", "Event before (,)", () => this.jump(-1)), on = button("on", "Next event (.)", () => this.jump(1));
    this.play.append(icon("pause")); back.append(icon("back")); on.append(icon("on"));
    this.speed = element("select", { "aria-label": "Speed", onchange: () => { clock.speed = Number(this.speed.value); } }, ...SPEEDS.map((value) => element("option", { value, selected: value === 1 }, `${value} ×`)));
    this.slider = element("input", { type: "range", min: "0", max: String(STEPS), value: "0", "aria-label": "Time", oninput: () => clock.seek(this.timeOf(Number(this.slider.value))) });
    this.marks = element("canvas", { class: "marks", "aria-hidden": "true" });
    this.text = element("output", { class: "time" });
    place.append(this.play, back, on, this.speed, element("div", { class: "slide" }, this.marks, this.slider), this.text, this.live);
    this.size = sizeOf(this.marks);
  }

  timeOf(step) { return this.store.first_s + (step / STEPS) * (this.store.last_s - this.store.first_s); }

  jump(direction) {
    const now = this.clock.time_s, events = this.store.events.filter((event) => JUMPED.includes(event.kind)).map((event) => event.t_s);
    const found = direction > 0 ? events.find((at) => at > now + 0.05) : events.filter((at) => at < now - 0.6).pop();
    if (found !== undefined) this.clock.seek(found);
  }

  draw(view) {
    const { store, clock } = this, span = store.last_s - store.first_s;
    const shown = clock.playing ? "pause" : "play";
    if (this.play.dataset.shown !== shown) { this.play.replaceChildren(icon(shown)); this.play.dataset.shown = shown; }
    say(this.text, clockText(store, view.moment));
    this.live.hidden = !clock.isLive();
    this.live.setAttribute("aria-pressed", String(clock.following));
    if (document.activeElement !== this.slider || clock.playing) this.slider.value = String(span > 0 ? Math.round(((view.time_s - store.first_s) / span) * STEPS) : 0);
    const key = `${store.events.length} ${Math.round(span)} ${this.size.width} ${view.colours.dark}`;
    if (key !== this.key) { this.key = key; this.drawMarks(view); }
  }

  drawMarks(view) {
    const { store } = this, { width, height } = this.size, context = this.marks.getContext("2d");
    this.marks.width = width; this.marks.height = height;
    const span = store.last_s - store.first_s;
    if (!(span > 0)) return;
    for (const event of store.events) {
      if (!JUMPED.includes(event.kind)) continue;
      context.fillStyle = event.kind === "phase" ? view.colours.ink : event.kind === "failure" || event.kind === "fault" ? view.colours.bad : view.colours.faint;
      context.fillRect(8 + ((event.t_s - store.first_s) / span) * (width - 16), 0, event.kind === "phase" ? 2 : 1, height);
    }
  }
}
