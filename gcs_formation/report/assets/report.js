// Connects legend, slider and plots.

function start() {
  const data = JSON.parse(document.getElementById("data").textContent);
  const [slider, clock, play] = ["time", "clock", "play"].map((id) => document.getElementById(id));
  const [pace, follow] = ["pace", "follow"].map((id) => document.getElementById(id));
  const state = {
    hidden: new Set(),
    time: data.flown_s[0],
    colour: (vehicle, colours) => data.vehicles[vehicle].colour ?? colours.ink,
    setTime: (t) => {
      state.time = Math.min(Math.max(t, Number(slider.min)), Number(slider.max));
      slider.value = state.time;
      clock.textContent = `${signed(state.time, 1)} s`;
      draw();
    },
    setFollowing: (on) => { follow.checked = on; plan.follow(on); },
    letGo: () => { follow.checked = false; plan.following = false; },
  };
  const errors = new ErrorPlot(document.getElementById("errors"), data, state);
  const plan = new PlanView(document.getElementById("plan"), data, state);
  const space = new SpaceView(document.getElementById("space"), data, state);
  const draw = () => [errors, plan, space].forEach((view) => view.draw());
  slider.min = data.tracks.t[0];
  slider.max = data.tracks.t[data.tracks.t.length - 1];
  slider.step = 0.1;
  slider.addEventListener("input", () => state.setTime(Number(slider.value)));
  follow.addEventListener("change", () => plan.follow(follow.checked));
  play.addEventListener("click", player(state, slider, play, pace));
  ranges(data, errors);
  legend(data, state, draw);
  state.setTime(data.flown_s[0]);
  window.addEventListener("resize", draw);
  window.addEventListener("beforeprint", () => [errors, plan, space].forEach((view) => view.paint()));
  window.addEventListener("afterprint", draw);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { legend(data, state, draw); draw(); });
}

function ranges(data, errors) {
  const [flown, steady] = ["flown", "steady"].map((id) => document.getElementById(id));
  flown.addEventListener("click", () => errors.zoom(...errors.first));
  steady.addEventListener("click", () => errors.zoom(data.steady_s, errors.first[1]));
  steady.hidden = data.steady_s === null;
}

function player(state, slider, button, pace) {
  let running = false;
  let last = 0;
  const step = (now) => {
    if (!running) return;
    state.setTime(state.time + ((now - last) / 1000) * Number(pace.value));
    last = now;
    if (state.time >= Number(slider.max)) stop();
    else requestAnimationFrame(step);
  };
  const stop = () => { running = false; button.textContent = "Play"; };
  return () => {
    if (running) { stop(); return; }
    running = true;
    button.textContent = "Pause";
    if (state.time >= Number(slider.max)) state.setTime(Number(slider.min));
    last = performance.now();
    requestAnimationFrame(step);
  };
}

function legend(data, state, draw) {
  const box = document.getElementById("legend");
  const colours = theme();
  const chips = data.vehicles.map((vehicle, i) => {
    const chip = document.createElement("button");
    const swatch = document.createElement("i");
    chip.type = "button";
    swatch.style.background = state.colour(i, colours);
    chip.append(swatch, vehicle.role === "leader" ? `leader ${vehicle.name}` : vehicle.name);
    chip.addEventListener("click", () => {
      if (!state.hidden.delete(i)) state.hidden.add(i);
      refresh();
    });
    return chip;
  });
  const refresh = () => {
    chips.forEach((chip, i) => chip.setAttribute("aria-pressed", String(!state.hidden.has(i))));
    draw();
  };
  const chooser = (name, chosen) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = name;
    button.addEventListener("click", () => {
      state.hidden = new Set(data.vehicles.keys());
      chosen.forEach((i) => state.hidden.delete(i));
      refresh();
    });
    return button;
  };
  const leaders = data.vehicles.map((vehicle, i) => (vehicle.role === "leader" ? i : -1)).filter((i) => i >= 0);
  const choosers = data.vehicles.length > 2 ? [chooser("All", [...data.vehicles.keys()])] : [];
  if (data.worst.length > 6) choosers.push(chooser("Largest errors", [...leaders, ...data.worst.slice(0, 5)]));
  box.replaceChildren(...choosers, ...chips);
  chips.forEach((chip, i) => chip.setAttribute("aria-pressed", String(!state.hidden.has(i))));
}

start();
