// @ts-check
// Live view of a watch: reads frames from the WebSocket of the page's server and draws them with the script of replays
// (assets/replay.js), whose data this script makes (crates/report/src/replay/data.rs).
"use strict";
(() => {
// Instants that are drawn, and the time between two [s].
const INSTANTS = 200, PERIOD_S = 0.1;
// Delay from which the shown state is not known [s], and largest relative rate of the clocks of server and browser.
const MOST_BEHIND_S = 1, DRIFT = 1e-4;
const root = /** @type {any} */ (document.querySelector(".replay"));
const verdict = /** @type {HTMLElement} */ (document.querySelector("#verdict"));
const log = /** @type {HTMLElement} */ (document.querySelector("#log"));
const start = root.querySelector(".replay-start").onclick;
/** @type {string[]} */
let names = [];
let delta = 1, radius = 0.1;
/** Middle and half sizes of the drawn box [m]. @type {number[][] | null} */
let box = null;
let waits = 500;
/** Places and closest pair that are drawn. */
let drawn = [0], near = [65535, 65535];
/** Time of the last frame on the clocks of the browser and the server, and smallest difference of both [s].
 * @type {{ arrival_s: number, t_s: number, least_s: number } | null} */
let last = null;

/** Packs numbers as base64. @param {ArrayBufferView} numbers */
const packed = numbers => {
  const bytes = new Uint8Array(numbers.buffer);
  let text = "";
  for (const byte of bytes) text += String.fromCharCode(byte);
  return btoa(text);
};

/** Starts the view around these positions. @param {(number[] | null)[]} places */
const restart = places => {
  const there = places.filter(at => at);
  const ends = [0, 1, 2].map(axis => {
    const all = there.map(at => at?.[axis] ?? 0);
    return [Math.min(...all), Math.max(...all)];
  });
  const middle = ends.map(([low, high]) => (low + high) / 2);
  const half = ends.map(([low, high]) => Math.max(high - low, 4 * delta, 1));
  box = [middle, half];
  const cell = 1e-3, count = names.length;
  const starts = new Int32Array(3 * count), steps = new Int16Array(3 * count * INSTANTS);
  places.forEach((at, k) => {
    for (let axis = 0; axis < 3; axis++)
      starts[3 * k + axis] = Math.round(((at?.[axis] ?? middle[axis]) - middle[axis]) / cell);
    if (!at) for (let row = 0; row < INSTANTS; row++) steps[3 * (row * count + k)] = -32768;
  });
  const reach = Math.max(half[0], half[1]), square = 10 ** Math.round(Math.log10(reach / 5));
  const lines = [], most = Math.ceil(reach / square) * square, low = Math.min(0, ends[2][0]) - middle[2];
  for (let at = -most; at <= most + square / 2; at += square)
    lines.push(at, -most, low, at, most, low, -most, at, low, most, at, low);
  const times = Float64Array.from({ length: INSTANTS }, (_, k) => (k + 1 - INSTANTS) * PERIOD_S);
  root.querySelector("script").textContent = JSON.stringify({
    vehicles: names, radius_m: names.map(() => radius), shell_m: [delta / 2, delta / 2, delta / 2],
    times_s: packed(times), decimals: 1, holds: false, origin_m: middle, middle_m: middle, half_m: half, cell_m: cell,
    rounding_m: cell, viewpoint: { azimuth_deg: -60, elevation_deg: 30, across: null }, square_m: square,
    ground: packed(Float32Array.from(lines)), points: count, starts: packed(starts), steps: packed(steps), rotors: null,
    turns: "", breaks: "", near_s: packed(Float64Array.of(times[0])), near_who: packed(Uint16Array.of(65535, 65535)),
    nearest: [], verdicts: [], moments: [], things: [], links: "", tension: false, delta_m: delta, formations: [],
    axis_m: 1, axes: null, reference: null,
  });
  start();
  // The present is the end of the shown time.
  root.querySelector(".replay-poster")?.remove();
  // A live view has no other time to play or to choose.
  for (const one of root.querySelectorAll(".replay-play, .replay-track, .replay-clock, [aria-label=Speed]"))
    one.style.display = "none";
  const scrub = root.querySelector("input[type=range]");
  if (scrub) {
    scrub.value = "0";
    scrub.oninput();
  }
};

/** Shows a state beside and in the view. @param {string} text @param {string} status @param {number[]} violated */
const show = (text, status, violated) => {
  verdict.textContent = text;
  verdict.dataset.status = status;
  // Without a box the view has other vehicles than the roster.
  if (box) root.player?.push(drawn, [-INSTANTS * PERIOD_S, status === "violation", text, violated, null], near);
};
/** Shows that the state is old. @param {number} behind_s */
const doubt = behind_s => show(`UNDECIDED: the page is ${behind_s.toFixed(1)} s behind`, "undecided", []);

/** Returns the delay of a frame beyond the smallest delay [s]. @param {number} t_s */
const delay = t_s => {
  const arrival_s = performance.now() / 1000, lag_s = arrival_s - t_s;
  // A clock that goes back is that of another watch.
  const before = last && t_s >= last.t_s ? last : null;
  const least_s = before ? Math.min(before.least_s + DRIFT * (arrival_s - before.arrival_s), lag_s) : lag_s;
  last = { arrival_s, t_s, least_s };
  return lag_s - least_s;
};

/** Returns the line of a notice, with its time. @param {any} notice */
const line = notice => `${notice.t_s === null ? "" : notice.t_s.toFixed(2) + " s: "}${notice.text}`;

/** Draws a frame. @param {any} frame */
const draw = frame => {
  const behind_s = delay(frame.state.t_s), isOld = behind_s > MOST_BEHIND_S;
  const places = frame.places.slice(0, names.length);
  const outside = places.some((/** @type {any} */ at) =>
    at && (!root.player || !box || [0, 1, 2].some(axis => Math.abs(at[axis] - box[0][axis]) > 2 * box[1][axis])));
  if (outside) restart(places);
  drawn = places.flatMap((/** @type {any} */ at) => {
    const from = box?.[0] ?? [0, 0, 0];
    return at ? [at[0] - from[0], at[1] - from[1], at[2] - from[2], at[3] ? 1 : 0] : [0, 0, 0, 0];
  });
  near = frame.near ?? [65535, 65535];
  if (isOld) doubt(behind_s); else show(line(frame.state), frame.state.status, frame.violated ?? []);
  root.dataset.frames = `${+(root.dataset.frames ?? 0) + 1}`;
};

/** Adds a notice to the log. @param {any} notice */
const note = notice => {
  if (notice.event === "state") return;
  const entry = document.createElement("li");
  entry.textContent = line(notice);
  log.prepend(entry);
  while (log.children.length > 200) log.lastChild?.remove();
};

const connect = () => {
  const socket = new WebSocket(`ws://${location.host}/live${location.search}`);
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
    show("UNDECIDED: the page lost its server and connects again", "undecided", []);
    setTimeout(connect, waits);
    waits = Math.min(2 * waits, 5000);
  };
};
connect();
// A server that stalls sends no frame.
setInterval(() => {
  if (!last) return;
  const behind_s = performance.now() / 1000 - last.t_s - last.least_s;
  if (performance.now() / 1000 - last.arrival_s > MOST_BEHIND_S) doubt(behind_s);
}, 250);
})();
