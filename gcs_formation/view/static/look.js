// Colours, elements and numbers as they are written.
"use strict";
// Okabe and Ito's colours, which colour-blind people can tell; the leader is drawn in the ink of the theme.
// The order is that of the report's figures.
const OKABE_ITO = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8C6D31"];
const LIGHTER = { "#0072B2": "#3D9BE0", "#D55E00": "#F07B2E", "#009E73": "#1FC197", "#8C6D31": "#BFA065" };

function theme() {
  const style = getComputedStyle(document.getElementById("viewer"));
  const of = (name) => style.getPropertyValue(`--${name}`).trim();
  return {
    ink: of("ink"), faint: of("faint"), line: of("line"), paper: of("paper"), panel: of("panel"),
    bad: of("bad"), warn: of("warn"), good: of("good"), dark: document.documentElement.dataset.theme === "dark",
  };
}

function colourOf(store, index, colours) {
  if (store.vehicles[index] === store.leaderName) return colours.ink;
  const leader = store.vehicles.indexOf(store.leaderName), follower = leader >= 0 && leader < index ? index - 1 : index;
  const colour = OKABE_ITO[follower % OKABE_ITO.length];
  return colours.dark ? LIGHTER[colour] || colour : colour;
}

// Sizes on canvases grow with the text of the page, which is larger on very large screens.
let em_px = 14;
const em = () => em_px / 14;
function measureText() { em_px = parseFloat(getComputedStyle(document.getElementById("viewer")).fontSize) || 14; }
addEventListener("resize", measureText);
addEventListener("load", measureText);
const font = (size, weight = "") => `${weight} ${Math.round(size * em())}px system-ui, sans-serif`.trim();

// An element; texts are always set as text, never as HTML.
function element(name, attributes = {}, ...children) {
  const found = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) found.addEventListener(key.slice(2), value);
    else if (key === "class") found.className = value;
    else if (value === true) found.setAttribute(key, "");
    else if (value !== false && value !== null && value !== undefined) found.setAttribute(key, value);
  }
  for (const child of children) found.append(child);
  return found;
}

// An element's width and height, kept up to date: asking at every frame would lay the page out again.
function sizeOf(node) {
  const size = { width: node.clientWidth, height: node.clientHeight };
  new ResizeObserver(() => { size.width = node.clientWidth; size.height = node.clientHeight; }).observe(node);
  return size;
}

function say(node, text) { if (node.textContent !== text) node.textContent = text; }

function number(value, digits = 1, unit = "") {
  return Number.isFinite(value) ? `${value.toFixed(digits).replace("-", "−")}${unit}` : "–";
}

function clockText(store, moment) {
  if (!moment) return "no tick yet";
  return store.zero_s ? `t = ${number(moment.time - store.zero_s, 1)} s` : `start + ${number(moment.time, 1)} s`;
}

const degrees = (rad) => ((Math.round((rad * 180) / Math.PI) % 360) + 360) % 360;

const ICONS = {
  play: "M5 3 L17 10 L5 17 Z", pause: "M5 3 H8 V17 H5 Z M12 3 H15 V17 H12 Z", back: "M4 3 H6 V17 H4 Z M17 3 L7 10 L17 17 Z", on: "M14 3 H16 V17 H14 Z M3 3 L13 10 L3 17 Z",
  follow: "M10 1 V6 M10 14 V19 M1 10 H6 M14 10 H19 M10 6 A4 4 0 1 0 10.01 6 Z", all: "M2 7 V2 H7 M13 2 H18 V7 M18 13 V18 H13 M7 18 H2 V13", plus: "M10 3 V17 M3 10 H17", minus: "M3 10 H17",
  theme: "M10 2 A8 8 0 1 0 10.01 2 Z M10 2 V18",
};

function icon(name) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg"), path = document.createElementNS("http://www.w3.org/2000/svg", "path");
  svg.setAttribute("viewBox", "0 0 20 20");
  svg.setAttribute("class", ["play", "pause", "back", "on"].includes(name) ? "icon solid" : "icon");
  svg.setAttribute("aria-hidden", "true");
  path.setAttribute("d", ICONS[name]);
  svg.append(path);
  return svg;
}
