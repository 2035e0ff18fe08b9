"use strict";
const by = (id) => document.getElementById(id);
const canvas = by("picture"), draw = canvas.getContext("2d");
const picture = new Image();
let state = null, shown = -1, loading = false, audio = null, events = null, reached = false;

/** Three significant digits and a unit; a dash where there is no number. */
function quantity(value, unit) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  const decimals = size === 0 || size >= 99.95 ? 0 : Math.min(6, Math.max(0, 2 - Math.floor(Math.log10(size))));
  return `${value.toFixed(decimals).replace("-", "−")} ${unit}`;
}

/** A distance in words. */
function distance(mm) {
  return mm < 1000 ? `${Math.round(mm / 10) * 10} mm` : `${(mm / 1000).toFixed(2)} m`;
}

function text(id, value) {
  if (by(id).textContent !== value) by(id).textContent = value;
}

/** A tone; browsers allow it once a key or a button was pressed. */
function tone(pitch, seconds, after = 0) {
  if (!audio || audio.state !== "running") return;
  const from = audio.currentTime + after, gain = audio.createGain(), voice = audio.createOscillator();
  voice.frequency.value = pitch;
  gain.gain.setValueAtTime(0.25, from);
  gain.gain.exponentialRampToValueAtTime(0.001, from + seconds);
  voice.connect(gain).connect(audio.destination);
  voice.start(from);
  voice.stop(from + seconds);
}

async function soundOn() {
  audio = audio || new AudioContext();
  await audio.resume();
  showSound();
}

function showSound() {
  const on = audio !== null && audio.state === "running";
  text("sound", on ? "sound is on" : "sound is off");
  by("sound").setAttribute("aria-pressed", String(on));
}

function outline(points, colour, width) {
  draw.beginPath();
  points.forEach(([x, y], i) => (i ? draw.lineTo(x + 0.5, y + 0.5) : draw.moveTo(x + 0.5, y + 0.5)));
  draw.closePath();
  draw.strokeStyle = colour;
  draw.lineWidth = width;
  draw.stroke();
}

/** The picture, the markers that were found, and the wanted pose. */
function paint() {
  const [width, height] = state.size;
  if (!width) return;
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
  if (picture.naturalWidth) draw.drawImage(picture, 0, 0, width, height);
  const line = width / 200;
  if (state.board) {
    draw.fillStyle = state.board.is_sharp && state.board.is_still ? "#58b7ff" : "#ff6f61";
    for (const [x, y] of state.board.markers) {
      draw.beginPath();
      draw.arc(x + 0.5, y + 0.5, line, 0, 2 * Math.PI);
      draw.fill();
    }
  }
  if (state.wanted && !state.is_over) {
    outline(state.wanted.outline, "#000a", 2 * line);
    outline(state.wanted.outline, state.wanted.is_reached ? "#31d07c" : "#ffb52e", 1.3 * line);
  }
}

/** The one thing to do now. */
function instruction() {
  if (state.is_over) return ["finished", "go"];
  if (state.source_ended) return ["the camera is gone", ""];
  if (!state.size[0]) return ["waiting for the camera", ""];
  if (!state.board) return ["show the board", ""];
  if (state.wanted && state.wanted.is_reached) {
    if (!state.board.is_still) return ["hold still", "go"];
    return state.board.is_sharp ? ["captured", "go"] : ["not sharp", ""];
  }
  if (state.wanted && state.wanted.hint) return [state.wanted.hint, ""];
  return ["move the board", ""];
}

function showWords() {
  const [words, kind] = instruction();
  text("instruction", words);
  by("instruction").className = kind;
  text("words", state.wanted && !state.is_over ? `wanted: ${state.wanted.words}` : "");
  text("message", state.is_over ? "the terminal has the calibration" : state.source_ended || state.message);
}

/** Errors, the goal, and what "enough" means. */
function showNumbers() {
  const fit = state.fit || {};
  text("count", String(state.count));
  text("fitted-px", quantity(fit.fitted_px, "px"));
  text("held-px", quantity(fit.held_px, "px"));
  text("fitted-mm", quantity(fit.fitted_mm, "mm"));
  text("held-mm", quantity(fit.held_mm, "mm"));
  const [head, meaning, enough] = goal(fit);
  text("enough", head);
  text("meaning", meaning + (state.is_fitting ? " (fitting …)" : ""));
  by("goal").className = enough ? "enough" : "";
}

function goal(fit) {
  const plan = fit.plan;
  if (!plan) return ["not yet enough", state.unfitted || fit.unplanned || "the first poses determine the camera", false];
  const range = plan.range_mm ? ` from ${distance(plan.range_mm[0])} to ${distance(plan.range_mm[1])}` : "";
  const about = plan.goal === "depth" ? `corrected depth${range}` : plan.goal === "projection" ? "projection" : plan.goal;
  const now = `With 95 % certainty the error of ${about} is below ${quantity(plan.now_95, plan.unit)}, as far as the model is right`;
  const aim = quantity(plan.within, plan.unit);
  if (plan.frames_needed === 0) return ["enough", `${now}; ${aim} was asked for. Further frames are not needed.`, true];
  if (plan.frames_needed === null) {
    const left = quantity(plan.reachable_95, plan.unit), helps = plan.now_95 > 1.1 * plan.reachable_95;
    return [helps ? "not yet enough" : "more hardly helps", `${now}. Frames like the wanted ones bring it to ${left}; ${aim} is not reached.`, false];
  }
  const more = plan.frames_needed;
  return [`${more} more ${more === 1 ? "frame" : "frames"}`, `${now}; like the wanted ones, they bring it below ${aim}.`, false];
}

const svg = (kind, attributes) => {
  const node = document.createElementNS(by("cells").namespaceURI, kind);
  Object.entries(attributes).forEach(([name, value]) => node.setAttribute(name, value));
  return node;
};

/** Kept frames over the image, over distance, and over tilt. */
function showCoverage() {
  const [columns, rows] = state.grid;
  const most = Math.max(1, ...state.cells);
  by("cells").replaceChildren(...state.cells.map((count, i) => svg("rect", {
    x: ((i % columns) * 80) / columns + 0.5, y: (Math.floor(i / columns) * 60) / rows + 0.5,
    width: 80 / columns - 1, height: 60 / rows - 1, fill: count ? "#58b7ff" : "#2a323b",
    "fill-opacity": count ? 0.25 + 0.75 * Math.sqrt(count / most) : 1,
  })));
  const dots = state.kept, near = Math.min(...dots.map((d) => d.distance_mm)), far = Math.max(...dots.map((d) => d.distance_mm));
  const along = (mm) => (far > near * 1.01 ? 6 + (68 * Math.log(mm / near)) / Math.log(far / near) : 40);
  by("distances").replaceChildren(...dots.map((d, i) => svg("circle", {
    cx: along(d.distance_mm), cy: 8 + (i * 23) % 44, r: 2, fill: "#58b7ff", "fill-opacity": 0.8,
  })));
  text("distance-words", dots.length ? `distance, ${distance(near)} to ${distance(far)}` : "distance");
  const rings = [20, 40, 60].map((degrees) => svg("circle", {
    cx: 40, cy: 30, r: degrees / 2.1, fill: "none", stroke: "#3a4550", "stroke-width": 0.5,
  }));
  const place = (degrees) => Math.max(-28, Math.min(28, degrees / 2.1));
  by("tilts").replaceChildren(...rings, ...dots.map((d) => svg("circle", {
    cx: 40 + place(d.turn_deg[1]), cy: 30 - place(d.turn_deg[0]), r: 2, fill: "#58b7ff", "fill-opacity": 0.8,
  })));
}

function ring() {
  if (events !== null && state.events !== events) {
    tone(880, 0.15);
    tone(1320, 0.25, 0.12);
  }
  events = state.events;
  const is_reached = Boolean(state.wanted && state.wanted.is_reached);
  if (is_reached && !reached) tone(440, 0.1);
  reached = is_reached;
}

/** The next picture, once the last one is there: a slow line skips pictures. */
function load() {
  if (loading || !state || state.picture === shown || !state.picture) return;
  loading = true;
  shown = state.picture;
  picture.src = `picture?number=${shown}`;
}
picture.onload = () => { loading = false; paint(); load(); };
picture.onerror = () => { loading = false; };

async function follow() {
  let version = 0;
  for (;;) {
    try {
      const answer = await fetch(`state?after=${version}`);
      if (!answer.ok) throw new Error(String(answer.status));
      state = await answer.json();
      version = state.version;
      showWords();
      showNumbers();
      showCoverage();
      ring();
      paint();
      load();
      if (state.is_over) return;
    } catch {
      text("instruction", "no connection");
      version = 0;
      await new Promise((later) => setTimeout(later, 500));
    }
  }
}

const ask = (path) => fetch(path, { method: "POST", headers: { "X-Depthcal": "live" } }).catch(() => {});
by("capture").onclick = () => { soundOn(); ask("capture"); };
by("take-back").onclick = () => { soundOn(); ask("take-back"); };
by("skip").onclick = () => ask("skip");
by("finish").onclick = () => by("sure").showModal();
by("sure").onclose = () => { if (by("sure").returnValue === "yes") ask("finish"); };
by("sound").onclick = async () => {
  if (audio && audio.state === "running") { await audio.suspend(); showSound(); } else { await soundOn(); tone(880, 0.15); }
};
document.addEventListener("keydown", (event) => {
  if (event.repeat || event.ctrlKey || event.metaKey || event.altKey || by("sure").open) return;
  const path = { " ": "capture", z: "take-back", Z: "take-back", n: "skip", N: "skip" }[event.key];
  if (path) { event.preventDefault(); soundOn(); ask(path); }
  if (event.key === "Enter") { event.preventDefault(); by("sure").showModal(); }
});
follow();
