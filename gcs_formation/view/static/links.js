// Links as numbers and bars: each vehicle's, and the radios that several share.
"use strict";
const LIMITS = { delay_s: 1, loss: 0.2, age_s: 2, rate_kbps: 60 }; // where bars end

class Links {
  constructor(place, store) {
    this.store = store;
    const { radios = [], delay_margin_s: margin_s } = store.meta.scene;
    this.radios = radios.map((radio) => ({ ...radio, columns: radio.vehicles.map((name) => store.vehicles.indexOf(name)).filter((v) => v >= 0) }));
    this.channels = this.table(place, ["radio of", "kbit/s down / up", "carries", "used"], this.radios.map(({ vehicles }) => namesOf(vehicles)));
    this.rows = this.table(place, ["", "up / down, ms", "jitter, ms", "loss, %", "age, ms", "kbit/s down / up", "margin used"], store.vehicles);
    this.reports = this.table(place, ["radio", "signal / noise", "at the far end", "buffer free"], store.vehicles);
    const words = [`Bars end at ${1e3 * LIMITS.delay_s} ms, ${100 * LIMITS.loss} %, ${LIMITS.age_s} s and ${LIMITS.rate_kbps} kbit/s`];
    words.push(`those of the margin at all of it, beyond which the loop is unstable${margin_s ? ` (${number(1e3 * margin_s, 0)} ms of delay in the slowest loop)` : ""}`);
    if (this.radios.length) words.push(`those of radios at ${100 * this.radios[0].usable} % of their rate, of which the rest goes with turning round, answers and bursts`);
    place.append(element("p", { class: "note" }, `${words.join("; ")}.`));
    if (!this.radios.length) this.channels.table.hidden = true;
  }

  table(place, heads, names) {
    const body = element("tbody"), table = element("table", { class: "links" }, element("thead", {}, element("tr", {}, ...heads.map((text) => element("th", { scope: "col" }, text)))), body);
    const rows = names.map((name) => {
      const cells = heads.map((_, i) => {
        if (!i) return { cell: element("th", { scope: "row" }, name) };
        const text = element("span"), fill = element("i"), bar = element("div", { class: "bar" }, fill);
        return { cell: element("td", {}, text, bar), text, fill, bar };
      });
      body.append(element("tr", {}, ...cells.map((each) => each.cell)));
      return cells;
    });
    place.append(element("div", { class: "scroll" }, table));
    return { table, rows };
  }

  draw() {
    this.radios.forEach((radio, i) => this.drawRadio(this.channels.rows[i], radio));
    this.rows.rows.forEach((cells, v) => this.drawLink(cells, (name) => this.store.get(v, name)));
    const reported = this.reports.rows.map((cells, v) => this.drawReport(cells, (name) => this.store.get(v, `radio_${name}`)));
    this.reports.table.hidden = !reported.includes(true);
  }

  drawRadio(cells, radio) {
    const sum = (name) => radio.columns.reduce((total, v) => total + (this.store.get(v, name) || 0), 0);
    const down = sum("rate_down_kbps"), up = sum("rate_up_kbps"), shares = [down / radio.down_kbps, up / radio.up_kbps];
    const used = radio.half_duplex ? shares[0] + shares[1] : Math.max(...shares);
    this.set(cells[1], `${number(down, 1)} / ${number(up, 1)}`);
    this.set(cells[2], radio.half_duplex && radio.up_kbps === radio.down_kbps ? `${number(radio.down_kbps, 1)} in turns` : `${number(radio.down_kbps, 1)} / ${number(radio.up_kbps, 1)}`);
    this.set(cells[3], `${number(100 * used, 0)} %`, used / radio.usable);
  }

  drawLink(cells, get) {
    const up = get("up_s"), down = get("down_s"), delay = get("delay_s"), split = Number.isFinite(up) && Number.isFinite(down);
    this.set(cells[1], split ? `${number(1e3 * up, 0)} / ${number(1e3 * down, 0)}` : `${number(1e3 * delay, 0)} each`, (split ? Math.max(up, down) : delay) / LIMITS.delay_s);
    this.set(cells[2], number(1e3 * get("jitter_s"), 1), get("jitter_s") / LIMITS.delay_s);
    this.set(cells[3], number(100 * get("loss"), 1), get("loss") / LIMITS.loss);
    this.set(cells[4], number(1e3 * get("age_s"), 0), get("age_s") / LIMITS.age_s);
    this.set(cells[5], `${number(get("rate_down_kbps"), 1)} / ${number(get("rate_up_kbps"), 1)}`, get("rate_down_kbps") / LIMITS.rate_kbps);
    this.set(cells[6], Number.isFinite(get("margin_used")) ? `${number(100 * get("margin_used"), 0)} %` : "–", get("margin_used"));
  }

  // Show what the radio of a vehicle's link says of itself; return whether it does.
  drawReport(cells, get) {
    const free = get("txbuf_percent"), pair = (signal, noise) => `${number(get(signal), 0)} / ${number(get(noise), 0)}`;
    cells[0].cell.parentElement.hidden = !Number.isFinite(free);
    this.set(cells[1], pair("rssi", "noise"));
    this.set(cells[2], pair("remrssi", "remnoise"));
    this.set(cells[3], `${number(free, 0)} %`, 1 - free / 100);
    return Number.isFinite(free);
  }

  set({ text, fill, bar }, words, share) {
    say(text, words);
    bar.hidden = share === undefined;
    fill.style.width = `${100 * Math.max(0, Math.min(1, Number.isFinite(share) ? share : 0))}%`;
    bar.classList.toggle("high", share > 0.7);
    bar.classList.toggle("over", share >= 1);
  }
}

// Vehicles that follow one another in few words: 1–4, 7.
function namesOf(names) {
  const runs = [];
  for (const name of names) {
    const last = runs[runs.length - 1];
    if (last && /^\d+$/.test(name) && Number(last[1]) + 1 === Number(name)) last[1] = name; else runs.push([name, name]);
  }
  return runs.map(([from, to]) => (from === to ? from : `${from}–${to}`)).join(", ");
}
