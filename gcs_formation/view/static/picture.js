// What all parts draw at a time: where vehicles and their slots are, and which vehicles are near to each other.
"use strict";
class Picture {
  constructor(store, texts) {
    this.store = store;
    this.texts = texts;
  }

  // What all parts draw: places, slots and distances at the clock's time.
  at(time_s, selected, colours) {
    const { store, texts } = this, moment = store.at(time_s);
    const vehicles = [...store.vehicles.keys()];
    const places = vehicles.map((v) => ["north_m", "east_m", "height_m", "heading_rad", "airspeed_mps"].map((name) => store.get(v, name)));
    const slots = vehicles.map((v) => ["slot_north_m", "slot_east_m", "slot_height_m"].map((name) => store.get(v, name)));
    const known = places.filter(([north]) => Number.isFinite(north)), mean = (k) => known.reduce((sum, place) => sum + place[k], 0) / known.length;
    const centre = selected >= 0 && Number.isFinite(places[selected][0]) ? places[selected] : [mean(0), mean(1), mean(2)];
    const heights = known.map((place) => place[2]);
    return {
      time_s, moment, places, slots, colours, selected, centre: centre.slice(0, 2), height: centre[2], floor: Math.min(0, ...heights),
      pairs: this.pairs(places), yields: (v) => store.get(v, "yielding") > 0, ahead: (v, s) => this.ahead(v, places[v], time_s, s), said: (name, kind) => texts.last(name, kind, time_s), doubted: (name) => texts.doubted(name, time_s),
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
}
