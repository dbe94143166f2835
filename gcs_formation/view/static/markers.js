// Vehicles' names beside them, as many as there is room for.
"use strict";
class Markers {
  constructor(stage, store, select) {
    this.place = element("div", { class: "markers", "aria-hidden": "true" });
    this.labels = store.vehicles.map((name, v) => element("button", { type: "button", tabindex: "-1", class: "marker", "data-marker": name, onclick: () => select(v) }, name));
    this.place.append(...this.labels);
    stage.append(this.place);
    this.shownAt = store.vehicles.map(() => "");
    this.size = sizeOf(stage);
  }

  draw(shown, view) {
    const { width, height } = this.size, size = em(), taken = [], places = this.labels.map((_, v) => shown.project(v, view));
    const covers = ([x, y]) => ([px, py]) => px > x + 2 * size && px < x + 32 * size && py > y - 26 * size && py < y - 4 * size;
    this.labels.forEach((label, v) => {
      const at = places[v];
      const inside = at && at[0] > -20 && at[1] > -20 && at[0] < width + 20 && at[1] < height + 20;
      const crowded = () => taken.some(([x, y]) => Math.abs(x - at[0]) < 22 * size && Math.abs(y - at[1]) < 16 * size) || places.some((other) => other && covers(at)(other));
      const free = inside && (v === view.selected || !crowded());
      if (label.hidden === free) label.hidden = !free;
      if (!free) return;
      taken.push(at);
      const moved = `translate(${Math.round(at[0] + 9 * size)}px, ${Math.round(at[1] - 24 * size)}px)`;
      if (moved !== this.shownAt[v]) label.style.transform = this.shownAt[v] = moved;
    });
  }
}
