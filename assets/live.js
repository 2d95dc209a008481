// @ts-check
// Live view of a watch: reads frames from the WebSocket of the page's server and draws them with the script of replays
// (assets/replay.js), whose data this script makes (crates/report/src/replay/data.rs).
"use strict";
(() => {
// Instants that are drawn, the usual time between two [s], and the least one.
const INSTANTS = 200, PERIOD_S = 0.1, LEAST_S = 1e-3;
// Corners of a box. ROOM is the half size of the box of the view over the extent of the vehicles and their trails.
const CORNERS = 8, ROOM = 0.65;
// Delay from which the shown state is not known [s], and largest relative rate of the clocks of server and browser.
const MOST_BEHIND_S = 1, DRIFT = 1e-4;
const root = /** @type {any} */ (document.querySelector(".replay"));
const part = (/** @type {string} */ id) => /** @type {HTMLElement} */ (document.getElementById(id));
const [band, icon, word, verdict, brake, sound, absent, pairs, facts, log] =
  ["band", "icon", "word", "verdict", "brake", "sound", "absent", "pairs", "facts", "log"].map(part);
const ICONS = { clear: "\u2713", warning: "\u26a0", undecided: "?", violation: "\u2716" };
// The first vehicle starts the view: there is nothing to start before.
const button = root.querySelector(".replay-start"), start = button.onclick;
button.remove();
/** Data of a view without vehicles. */
const empty = JSON.parse(root.querySelector("script").textContent);
/** @type {string[]} */
let names = [];
let delta = 1, radius = 0.1;
/** Middle and half sizes of the drawn box [m]. @type {number[][] | null} */
let box = null;
/** Last instants, the oldest first: their times [s], and places and speeds of the vehicles.
 * @type {{ t_s: number, present: (number[] | null)[] }[]} */
let past = [];
let waits = 500;
/** Places and closest pair that are drawn. */
let drawn = [0], speeds = [0], near = [65535, 65535];
/** Time since the instant that was drawn before [s]. */
let long_s = PERIOD_S;
/** Time of the last frame on the clocks of the browser and the server, and smallest difference of both [s].
 * @type {{ arrival_s: number, sent_s: number, least_s: number } | null} */
let last = null;
/** Whether the watch has ended, so that its result is shown. */
let hasEnded = false;

/** Packs numbers as base64. @param {ArrayBufferView} numbers */
const packed = numbers => {
  const bytes = new Uint8Array(numbers.buffer);
  let text = "";
  for (const byte of bytes) text += String.fromCharCode(byte);
  return btoa(text);
};

/**
 * Returns x, y, z from the middle of the box [m] and 1 or 0 for each vehicle. @param {any[]} places
 * @returns {number[]}
 */
const placed = places => places.flatMap(at =>
  at ? [...[0, 1, 2].map(axis => at[axis] - (box?.[0][axis] ?? 0)), at[3] ? 1 : 0] : [0, 0, 0, 0]);

/** Returns the speed of each vehicle [m/s], NaN if it is not known. @param {any[]} places @returns {number[]} */
const speedsOf = places => places.map(at => at?.[4] ?? NaN);

/**
 * Returns instants in which the vehicles are at the corners of the box. The camera fits all instants, and thus the box.
 * @param {number[]} half
 */
const corners = half => Array.from({ length: CORNERS }, (_, k) => names.flatMap((_, vehicle) => {
  const corner = vehicle + k;
  // A visit of its own keeps an instant out of the trails.
  return [...half.map((size, axis) => corner >> axis & 1 ? size : -size), k + 2];
}));

/** Controls of the view: choices and layers. @returns {any[]} */
const controls = () => [...root.querySelectorAll(".replay-buttons :is(select, input)")];

/** Starts the view with a box around the last positions and their trails. Keeps the choices of the old view. */
const restart = () => {
  const ends = [0, 1, 2].map(() => [Infinity, -Infinity]);
  for (const at of past.flatMap(instant => instant.present)) if (at) ends.forEach((end, axis) => {
    end[0] = Math.min(end[0], at[axis]);
    end[1] = Math.max(end[1], at[axis]);
  });
  for (const end of ends) if (end[0] > end[1]) end.fill(0);
  const middle = ends.map(([low, high]) => (low + high) / 2);
  const half = ends.map(([low, high]) => Math.max(ROOM * (high - low), 2 * delta, 1));
  box = [middle, half];
  const reach = Math.max(half[0], half[1]), square = 10 ** Math.round(Math.log10(reach / 5));
  const most = Math.ceil(reach / square) * square, low = Math.min(0, ends[2][0]) - middle[2];
  const kept = past.slice(CORNERS - INSTANTS), newest_s = kept.at(-1)?.t_s ?? 0;
  const oldest_s = (kept[0]?.t_s ?? 0) - newest_s, before = INSTANTS - kept.length;
  const times = Float64Array.from({ length: INSTANTS }, (_, k) =>
    k < before ? oldest_s + (k - before) * PERIOD_S : kept[k - before].t_s - newest_s);
  const first = Float64Array.of(times[0]), nobody = Uint16Array.of(65535, 65535);
  const trails = kept.map(instant => placed(instant.present)), absent = placed(names.map(() => null));
  const free = Array.from({ length: INSTANTS - CORNERS - trails.length }, () => absent);
  root.querySelector("script").textContent = JSON.stringify({
    ...empty, vehicles: names, radius_m: names.map(() => radius), shell_m: [delta / 2, delta / 2, delta / 2],
    delta_m: delta, clearance_m: delta, times_s: packed(times), points: names.length,
    starts: packed(new Int32Array(3 * names.length)), places: [...corners(half), ...free, ...trails],
    speeds: kept.map(instant => speedsOf(instant.present)), cell_m: 1,
    origin_m: middle, middle_m: middle, half_m: half, swarm_m: half, square_m: square,
    ground: [[-most, -most, low], [most, most, low]], near_s: packed(first), near_who: packed(nobody),
  });
  const old = controls(), hasFocus = document.activeElement?.matches(".replay-view");
  // The start of a replay moves the focus into the view, and thus scrolls the page. An inert view takes no focus.
  root.inert = true;
  start();
  root.inert = false;
  if (hasFocus) root.querySelector("canvas")?.focus({ preventScroll: true });
  controls().forEach((control, k) => {
    const name = control.ariaLabel;
    // The camera has a new position, and no vehicle is picked.
    if (!old[k] || name === "Speed" || (name === "Camera" && old[k].value !== "swarm")) return;
    [control.value, control.checked] = [old[k].value, old[k].checked];
    control.onchange();
  });
  // The view holds the newest instant.
  long_s = LEAST_S;
  // A live view has no other time to play or to choose.
  for (const one of root.querySelectorAll(".replay-play, .replay-track, .replay-clock, [aria-label=Speed]"))
    one.style.display = "none";
  const scrub = root.querySelector("input[type=range]");
  if (scrub) {
    scrub.value = "0";
    scrub.oninput();
  }
};

/** Plays a tone. @type {((hertz: number, from_s: number) => void) | null} */
let tone = null;
sound.onclick = () => {
  if (tone) tone = null;
  else {
    const context = new AudioContext();
    tone = (hertz, from_s) => {
      const [source, gain] = [context.createOscillator(), context.createGain()];
      const begin_s = context.currentTime + from_s;
      source.frequency.value = hertz;
      gain.gain.setValueAtTime(0.2, begin_s);
      gain.gain.linearRampToValueAtTime(0, begin_s + 0.15);
      source.connect(gain).connect(context.destination);
      source.start(begin_s);
      source.stop(begin_s + 0.15);
    };
    tone(660, 0);
  }
  sound.textContent = `Sound: ${tone ? "on" : "off"}`;
  sound.setAttribute("aria-pressed", `${!!tone}`);
};
/** Frequencies of the tones of a level [Hz]. @type {Object<string, number[]>} */
const TONES = { violation: [880, 880, 880], warning: [660, 660], undecided: [330], clear: [] };
// Time after which the tones of an alarm sound again [s].
const REPEATS_S = 2;
let level = "undecided", sounded_s = 0;
/** Sounds the tones of a new level, and again while a violation or a warning lasts. @param {string} next */
const ring = next => {
  const now_s = performance.now() / 1000, isAlarm = next === "violation" || next === "warning";
  if (next !== level || (isAlarm && now_s - sounded_s >= REPEATS_S)) {
    TONES[next].forEach((hertz, k) => tone?.(hertz, 0.25 * k));
    sounded_s = now_s;
  }
  level = next;
};

/** Shows a state in the band, in the tab and in the view.
 * @param {string} said @param {string} status
 * @param {{ violated?: number[], warning?: string, brake?: string, name?: string }} more */
const show = (said, status, { violated = [], warning = "", brake: by = "", name = status.toUpperCase() } = {}) => {
  const next = status !== "violation" && warning ? "warning" : status;
  ring(next);
  const text = name + (warning ? `, ${warning}` : "");
  band.dataset.level = verdict.dataset.status = next;
  icon.textContent = ICONS[/** @type {keyof typeof ICONS} */ (next)];
  if (word.textContent !== text) word.textContent = text;
  verdict.textContent = said;
  brake.textContent = by;
  document.title = `${icon.textContent} ${by || text} - tautline watch`;
  // Without a box the view has other vehicles than the roster. The sentence is in the band: it would cover the view.
  if (box) root.player?.push(drawn, speeds, long_s, [-Infinity, next === "violation", text, violated, null], near);
  long_s = LEAST_S;
};
/** Shows that the state is old. @param {number} behind_s */
const doubt = behind_s => show(`the page is ${behind_s.toFixed(1)} s behind`, "undecided");

/** Returns the delay of a frame beyond the smallest delay [s]. @param {number} sent_s */
const delay = sent_s => {
  const arrival_s = performance.now() / 1000, lag_s = arrival_s - sent_s;
  // A clock that goes back is that of another watch.
  const before = last && sent_s >= last.sent_s ? last : null;
  const least_s = before ? Math.min(before.least_s + DRIFT * (arrival_s - before.arrival_s), lag_s) : lag_s;
  last = { arrival_s, sent_s, least_s };
  return lag_s - least_s;
};

/** Returns the line of a notice, with its time. @param {any} notice */
const line = notice => `${notice.t_s === null ? "" : notice.t_s.toFixed(2) + " s: "}${notice.text}`;

/** Returns a sentence without its first word, which the band shows. @param {string} text */
const rest = text => text.replace(/^(CLEAR|UNDECIDED|VIOLATION|OFF PLAN):? /, "");

/** Replaces the items of a list. @param {HTMLElement} list @param {string[]} items */
const fill = (list, items) => list.replaceChildren(...items.map(item => {
  const entry = document.createElement("li");
  entry.textContent = item;
  return entry;
}));

/** Shows the closest pairs, the bounds, and which vehicles are not drawn. @param {any} frame */
const list = frame => {
  pairs.replaceChildren(...(frame.pairs ?? []).map((/** @type {number[]} */ [a, b, nominal, least]) => {
    const row = document.createElement("tr");
    const cells = [`${names[a]} and ${names[b]}`, nominal.toFixed(2), Math.max(least, 0).toFixed(2)];
    row.append(...cells.map((text, k) => {
      const cell = document.createElement("td");
      cell.textContent = text;
      if (k) Object.assign(cell, { className: "number" }).dataset.label = ["", "expected [m]", "at least [m]"][k];
      return cell;
    }));
    if (nominal < delta) row.className = "reasons";
    return row;
  }));
  // The roster of the first vehicle names delta.
  fill(facts, [...names.length ? [`delta ${delta} m`] : [], ...frame.facts ?? []]);
  const { heard, stale, signed_off: off } = frame.state, isDrawn = root.dataset.state === "ready";
  const shown = isDrawn ? drawn.filter((_, k) => k % 4 === 3 && drawn[k]).length : 0;
  const named = (/** @type {string} */ what, /** @type {string[]} */ of) =>
    of.length ? ` ${what}: ${of.join(", ")}.` : "";
  absent.textContent = `${shown} of ${heard} vehicles are drawn.`
    + named("Stale", stale) + named("Signed off", off);
  absent.className = stale.length ? "reasons" : "";
};

/** Draws a frame. @param {any} frame */
const draw = frame => {
  hasEnded = false;
  const behind_s = delay(frame.sent_s), isOld = behind_s > MOST_BEHIND_S;
  const places = frame.places.slice(0, names.length);
  const present = places.map((/** @type {any} */ at) => at?.[3] ? at : null);
  const now_s = frame.state.t_s, before_s = past.at(-1)?.t_s ?? now_s - PERIOD_S;
  // A clock that goes back is that of another watch.
  long_s = Math.max(now_s - before_s, LEAST_S);
  past = [...past, { t_s: before_s + long_s, present }].slice(-INSTANTS);
  const [middle, half] = box ?? [[0, 0, 0], [-1, -1, -1]];
  const outside = present.some((/** @type {any} */ at) =>
    at && half.some((size, axis) => Math.abs(at[axis] - middle[axis]) > size));
  if (outside) restart();
  [drawn, speeds] = [placed(places), speedsOf(places)];
  near = frame.near ?? [65535, 65535];
  if (isOld) doubt(behind_s); else {
    const { t_s, status, text, last_brake: by, nominal_violation: ahead } = frame.state;
    const left_s = by && by.at_s - t_s;
    // Rounded down: the moment is not later.
    const when = left_s > 0 ? `within ${(Math.floor(10 * left_s) / 10).toFixed(1)} s` : "now";
    show(`${t_s.toFixed(2)} s: ${rest(text)}`, status, {
      violated: frame.violated ?? [],
      warning: [status !== "violation" && ahead && "on course to violate", frame.off_plan && "OFF PLAN"]
        .filter(Boolean).join(", "),
      brake: status === "violation" || !by ? "" : `brake ${by.subjects.join(" and ")} ${when}`,
    });
  }
  list(frame);
  root.dataset.frames = `${+(root.dataset.frames ?? 0) + 1}`;
};

/** Shows the result of the watch. @param {any} result */
const conclude = result => {
  hasEnded = true;
  last = null;
  const words = result.status === "clear" && result.off_plan ? [] : [result.status.toUpperCase()];
  if (result.off_plan) words.push("OFF PLAN");
  const name = `ENDED: ${words.join(", ")}`;
  show(`the watch has ended: ${rest(result.text)}`, result.off_plan ? "violation" : result.status, { name });
  pairs.replaceChildren();
  absent.textContent = "The watch has ended: the view shows its last positions.";
};

/** Adds a notice to the log. @param {any} notice */
const note = notice => {
  if (notice.event === "state") return;
  if (notice.event === "summary") conclude(notice);
  const entry = document.createElement("li");
  entry.textContent = line(notice);
  log.prepend(entry);
  while (log.children.length > 200) log.lastChild?.remove();
};

const connect = () => {
  const socket = new WebSocket(`ws://${location.host}/live${location.search}`);
  past = [];
  socket.onmessage = event => {
    waits = 500;
    const message = JSON.parse(event.data);
    if (message.op === "roster") {
      names = message.vehicles;
      delta = message.delta_m ?? delta;
      radius = Math.min(0.1, delta / 4);
      box = null;
    } else if (message.op === "frame") draw(message);
    else note(message.notice);
  };
  socket.onclose = () => {
    last = null;
    if (!hasEnded) show("the page lost its server and connects again", "undecided");
    setTimeout(connect, waits);
    waits = Math.min(2 * waits, 5000);
  };
};
connect();
// A server that stalls sends no frame.
setInterval(() => {
  if (!last) return;
  const behind_s = performance.now() / 1000 - last.sent_s - last.least_s;
  if (performance.now() / 1000 - last.arrival_s > MOST_BEHIND_S) doubt(behind_s);
}, 250);
})();
