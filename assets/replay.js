// @ts-check
// Draws replays of flights with WebGL 2. Reads a page's JSON (crates/report/src/replay/data.rs) and shaders
// (shaders/replay.glsl). Distances, times and verdicts in words come from that data; positions serve drawing alone.
//
// The page holds this file without lines that begin with `//`, JSDoc blocks and indentation. Other comments stay in it.
"use strict";
(() => {
/**
 * Numbers as base64 of their little-endian bytes: `times_s` and `near_s` are doubles, `starts` 32-bit integers, `steps`
 * 16-bit integers, `breaks`, `near_who` and `links` unsigned 16-bit integers, all others single precision.
 * @typedef {string} Packed
 */
/**
 * Finding that a button jumps to: its vehicles, its obstacle and its sentence. `at_s` is its worst time.
 * @typedef {{kind: string, who: number[], thing: number | null, from_s: number, to_s: number, at_s: number,
 *   said: string}} Moment
 */
/**
 * Obstacle. `radius_m` is that of a ball, which has no triangles. `path` is a list of [t, x, y, z].
 * @typedef {{radius_m: number | null, solid: Packed, rims: Packed, opacity: number,
 *   path: number[][]}} Thing
 */
/**
 * Verdict from a time [s] on: time, whether it is a violation, its sentence, vehicles and obstacle of the violation.
 * @typedef {[number, boolean, string, number[], number | null]} Verdict
 */
/**
 * Data of a page: struct `Data` in crates/report/src/replay/data.rs says more. A live view has `places` and
 * `speeds` for its last instants in the form of `push`.
 * @typedef {{limits: {named: number, trails: number[], drops: number, slots: number, links: number, colours: number},
 *   tangent: number, light: number[], vehicles: string[], radius_m: number[], shell_m: number[] | null,
 *   times_s: Packed, middle_m: number[], origin_m: number[], half_m: number[], swarm_m: number[], cell_m: number,
 *   viewpoint: {azimuth_deg: number, elevation_deg: number, across: number | null},
 *   points: number, starts: Packed,
 *   steps: Packed, breaks: Packed, near_s: Packed, near_who: Packed, holds: boolean, nearest: [number, string][],
 *   verdicts: Verdict[], follows: boolean, decimals: number, moments: Moment[], things: Thing[],
 *   ground: number[][], square_m: number,
 *   clearance_m: number, rotors: {ends_m: number[][], rotor_m: number, body_m: number, arm_m: number} | null,
 *   turns: Packed, links: Packed, link_look: [number, number], tension: boolean,
 *   delta_m: number, lights: boolean, formations: {from_s: number, slots: Packed}[], axis_m: number,
 *   axes: number | null, reference: number | null, places?: number[][], speeds?: (number | null)[][]}} Data
 */
/** @typedef {{vao: WebGLVertexArrayObject | null, count: number, buffer: WebGLBuffer | null}} Mesh */
/** @typedef {{made: WebGLProgram, at: Object<string, WebGLUniformLocation>}} Program */

// A step of ABSENT along x marks a point that is not there. RED is the largest number of red pieces of trails. The
// camera fits at most SAMPLES positions.
const ABSENT = -32768, TRAIL_PIECES = 24000, RED = 40000, SAMPLES = 4000;
const UPRIGHT = Math.PI / 2;
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8, 16, 32, 64];
// Uniforms that are integers.
const WHOLE = new Set(["path", "paint", "value", "turn", "row", "next", "points", "kind", "stride", "newest", "axis",
  "mark"]);
// Names of the page's colours (crates/report/src/drawing/colours.rs): `c` for vehicles, `q` for quantities from small
// to large, `l` for lights from the left to the right of the swarm.
const QUANTITIES = ["q1", "q2", "q3", "q4"], LIGHTS = ["l1", "l2", "l3", "l4"];
const COLOURS = ["sky", "ink", "floor", "shell", "thing", "alarm", "push", "rest", "pull", "night", "c1", "c2", "c3",
  "c4", "c5", "c6", "c7", "c8", ...QUANTITIES, ...LIGHTS];
// Layers in the order of their keys 1 to 8.
const LAYERS = ["shells", "links", "trails", "slots", "ground", "names", "closest", "caption"];
// An entry with a third word is there if the flight has such a moment or layer.
const HELP = [["Space", "play, pause"], ["Left, Right", "previous, next instant; with Shift one second"],
  ["Home, End", "start, end"], ["Up, Down or +, -", "faster, slower"], ["N", "closest approach", "closest"],
  ["B, Shift+B", "next, previous violation", "violation"], ["U", "next undecided time", "undecided"],
  ["1, 2, 3", "perspective, top, front"],
  ["F", "follow the picked vehicle or the swarm; again: the whole flight"],
  ["T", "trails: whole, short, none", "trails"],
  ["C", "colour by vehicle, speed, clearance, lights"], ["L", "labels"], ["W, A, S, D or drag", "turn the camera"],
  ["right drag", "move the camera"], ["Page Up, Page Down or wheel", "zoom"],
  ["click, V", "pick a vehicle, the next vehicle"], ["M", "dark or light background"], ["P", "save a picture"],
  ["H", "help"]];

const bytes = (/** @type {Packed} */ packed) => Uint8Array.from(atob(packed), letter => letter.charCodeAt(0)).buffer;
/** @param {number[]} colour Red, green and blue from 0 to 255. @param {number} [alpha] */
const rgba = (colour, alpha = 1) => [...colour.map(part => part / 255), alpha];
const css = (/** @type {number[]} */ colour) => `rgb(${colour})`;
/** @param {number} x @param {number} low @param {number} high */
const clamp = (x, low, high) => Math.min(Math.max(x, low), high);
/** @param {ArrayLike<number>} a @param {ArrayLike<number>} b */
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
/**
 * Returns the point at a share of the way from one point to another.
 * @param {ArrayLike<number>} a @param {ArrayLike<number>} b @param {number} share
 */
const mix = (a, b, share) => [0, 1, 2].map(axis => a[axis] + (b[axis] - a[axis]) * share);
/**
 * Counts the entries of a sorted list that are at most `value`.
 * @param {ArrayLike<number>} sorted @param {number} value
 */
const upTo = (sorted, value) => {
  let low = 0;
  for (let high = sorted.length; low < high;) {
    const middle = low + high >> 1;
    if (sorted[middle] <= value) low = middle + 1; else high = middle;
  }
  return low;
};
/**
 * Returns the last entry whose time is at most `t`.
 * @template {[number, ...any]} T @param {T[]} list @param {number} t @returns {T | undefined}
 */
const latest = (list, t) => list[upTo(list.map(entry => entry[0]), t) - 1];
/**
 * Makes an element of HTML.
 * @param {string} tag @param {Object<string, string>} attributes @param {(Node | string)[]} children @returns {any}
 */
const make = (tag, attributes, ...children) => {
  const element = document.createElement(tag);
  for (const name in attributes) element.setAttribute(name, attributes[name]);
  return element.append(...children), element;
};
/**
 * Sets a text that differs: screen readers announce every write.
 * @param {Element} element @param {string} text
 */
const write = (element, text) => { if (element.textContent !== text) element.textContent = text; };

// Shaders begin with a line `@ NAME` or `@ NAME BASE`.
const pieces = (document.querySelector("script[type='x-shader']")?.textContent ?? "")
  .split("@ ").map(piece => piece.split(/\n([^]*)/));
/** Returns the source of a shader, behind the sources of its bases. @param {string} name @returns {string} */
const shader = name => {
  const [title = "", own = ""] = pieces.find(([title]) => title.split(" ")[0] === name) ?? [];
  const base = title.split(" ")[1];
  return (base ? shader(base) : "") + own;
};

/** Adds the player of a flight to a page. @param {HTMLElement} root @param {Data} data */
const play = (root, data) => {
  const count = data.vehicles.length, half = data.half_m, reach = Math.hypot(...half);
  const { radius_m: radius, moments, limits, tangent: TANGENT } = data, least_m = Math.min(...radius);
  const times = new Float64Array(bytes(data.times_s));
  const first = times[0], last = times[times.length - 1];
  const nearS = new Float64Array(bytes(data.near_s)), nearWho = new Uint16Array(bytes(data.near_who));
  // Texture with a row for each instant. A column for each point holds its position from the origin [m] and the number
  // of its visit: 0 where the point is absent, one more behind each break. The last column holds the time [s].
  const wide = data.points + 1, path = new Float32Array(times.length * wide * 4);
  {
    const cells = Array.from(new Int32Array(bytes(data.starts))), steps = new Int16Array(bytes(data.steps));
    const breaks = new Uint16Array(bytes(data.breaks)), visit = new Float32Array(data.points).fill(1);
    for (let row = 0, step = 0, to = 0, broken = 0; row < times.length; row++) {
      for (let k = 0; k < data.points; k++, step += 3, to += 4) {
        const there = steps[step] > ABSENT, breaking = breaks[broken] === row && breaks[broken + 1] === k;
        if (breaking) broken += 2;
        if (breaking || !there) visit[k]++;
        for (let axis = 0; axis < 3; axis++) {
          if (there) cells[3 * k + axis] += steps[step + axis];
          path[to + axis] = cells[3 * k + axis] * data.cell_m + (data.middle_m[axis] - data.origin_m[axis]);
        }
        path[to + 3] = there ? visit[k] : 0;
      }
      path[to] = times[row] - first;
      to += 4;
    }
    data.places?.forEach((at, k, all) => path.set(at, (times.length - all.length + k) * wide * 4));
  }
  // Speeds that the data states [m/s], NaN where one is not known.
  const stated = data.speeds ? new Float32Array(times.length * count).fill(NaN) : null;
  data.speeds?.forEach((speeds, k, all) =>
    stated?.set(speeds.map(speed => speed ?? NaN), (times.length - all.length + k) * count));

  // Attitudes as quaternions x, y, z, w, in a texture like that of positions.
  const rotors = data.rotors, turned = new Float32Array(rotors ? times.length * count * 4 : 4);
  if (rotors) {
    const parts = new Int8Array(bytes(data.turns));
    for (let from = 0, to = 0; from < parts.length; from += 3, to += 4) {
      const vector = [0, 1, 2].map(axis => parts[from + axis] / 127);
      turned.set([...vector, Math.sqrt(Math.max(1 - Math.hypot(...vector) ** 2, 0))], to);
    }
  }
  const arm = rotors?.arm_m ?? 0;
  // Distance from the centre to the farthest drawn point of each vehicle [m].
  const outer = rotors ? radius.map(() => arm + rotors.rotor_m) : radius;
  const shell = data.shell_m ? Math.max(...data.shell_m) : 0;

  // Elements.
  const canvas = /** @type {HTMLCanvasElement} */ (make("canvas", {
    class: "replay-view", tabindex: "0", role: "img",
    "aria-label": "Flight in 3-D. Space plays, arrows step, W, A, S and D turn, H lists all keys." }));
  const gl = /** @type {WebGL2RenderingContext} */ (canvas.getContext("webgl2", { alpha: false, antialias: true }));
  if (!gl) throw new Error("This browser does not draw WebGL 2: "
    + (root.querySelector(".replay-still") ? "a still picture replaces the replay." : "there is no view."));
  const names = /** @type {HTMLCanvasElement} */ (make("canvas", { class: "replay-names", "aria-hidden": "true" }));
  const state = make("p", { class: "replay-state" }), chosen = make("p", { class: "replay-picked" });
  const scale = make("p", { class: "replay-scale" });
  const said = make("p", { class: "replay-said", role: "status" }), clock = make("output", { class: "replay-clock" });
  const head = make("i", { class: "replay-head" });
  const button = (/** @type {string} */ text, /** @type {string} */ keys, /** @type {() => void} */ act) =>
    Object.assign(make("button", { type: "button", ...keys && { "aria-keyshortcuts": keys, title: "key " + keys } },
      text), { onclick: act });
  const start = Object.assign(button("Play", "Space", () => toggle()), { className: "replay-play" });
  const scrub = make("input", { type: "range", min: `${first}`, max: `${last}`, step: "any", "aria-label": "Time" });
  scrub.oninput = () => go(+scrub.value);
  /**
   * Makes a list of choices; every entry is a value and its text.
   * @param {string} label @param {[string, string][]} choices @param {() => void} act
   */
  const select = (label, choices, act) => Object.assign(make("select", { "aria-label": label, title: label },
    ...choices.map(([value, text]) => make("option", { value }, text))), { onchange: () => { act(); ask(); } });
  const speeds = select("Speed", SPEEDS.map(x => [`${x}`, "× " + x]), () => {});
  // Real time unless the flight would then take more than 30 s.
  speeds.value = SPEEDS.find(x => (last - first) / x <= 30) ?? 64;
  // Trails of many vehicles would hide them.
  const usual = count <= limits.trails[0] ? Infinity : count <= limits.trails[1] ? 5 : 1;
  const span = last - first, tails = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000].filter(x => x < span)
    .filter((x, k, all) => x === usual || k > all.length - 5);
  const tail = select("Length of trails", [["Infinity", "whole trails"],
    .../** @type {[string, string][]} */ (tails.map(x => [`${x}`, `trails of ${x} s`]))], () => {});
  if (tails.includes(usual)) tail.value = `${usual}`;
  const follow = select("Camera", [["", "free camera"], ["swarm", "follow the swarm"],
    ["picked", "follow picked"]], () => approach());
  const kinds = /** @type {[string, string][]} */ ([["", "colour: vehicle"],
    ...data.holds ? [] : [["speed", "colour: speed"]], ...count > 1 ? [["clearance", "colour: clearance"]] : [],
    ["lights", "colour: lights"]]);
  const colouring = select("Colour", kinds, () => recolour());
  const jumps = /** @type {[string, string, string, number][]} */ ([
    ["Closest approach", "N", "closest", 1], ["Previous violation", "Shift+B", "violation", -1],
    ["Next violation", "B", "violation", 1], ["Next undecided", "U", "undecided", 1]])
    .filter(([,, kind]) => moments.some(moment => moment.kind === kind))
    .map(([text, keys, kind, way]) => button(text, keys, () => jump(kind, way)));
  const views = [button("Perspective", "1", () => look(0)), button("Top", "2", () => look(1)),
    button("Front", "3", () => look(2)), button("Show all", "", () => { fit(); ask(); })];
  /** @type {Object<string, boolean>} */
  const shows = { shells: !!data.shell_m, links: !!data.links, trails: !data.holds, slots: data.axes !== null,
    ground: true, names: true, closest: count > 1, caption: true };
  /** Samples of the legend, as backgrounds. @type {Object<string, string>} */
  const samples = { shells: "radial-gradient(circle closest-side,transparent 70%,var(--shell))",
    links: "linear-gradient(90deg,var(--push),var(--rest),var(--pull))",
    trails: "linear-gradient(90deg,transparent,var(--c1))",
    slots: "radial-gradient(circle closest-side,transparent 65%,var(--c1) 66% 85%,transparent 86%)",
    closest: "linear-gradient(transparent 35%,var(--ink) 35% 65%,transparent 65%)" };
  /** @type {Object<string, string>} */
  const words = { shells: "keep-out shells", links: "links: push, rest, pull",
    slots: "slots", ground: `squares of ${data.square_m} m`, closest: "closest two" };
  const swatch = (/** @type {string} */ background) =>
    make("i", { class: "replay-swatch", style: "background:" + background });
  // Layers that would hide the formation, or outshine lights, are off at first.
  const off = new Set(data.lights ? LAYERS.filter(name => name !== "caption")
    : [...bytes(data.links).byteLength > 4 * limits.links ? ["links"] : [], ...count > limits.slots ? ["slots"] : []]);
  const boxes = new Map(LAYERS.filter(name => shows[name]).map(name => {
    shows[name] = !off.has(name);
    const box = make("input", { type: "checkbox", ...shows[name] && { checked: "" } });
    box.onchange = () => { shows[name] = box.checked; ask(); };
    return [name, box];
  }));
  const legend = [...boxes].map(([name, box]) =>
    make("label", {}, box, ...samples[name] ? [swatch(samples[name])] : [], words[name] ?? name));
  const has = (/** @type {string} */ kind) => moments.some(moment => moment.kind === kind);
  for (const [drawn, sample, text] of /** @type {[boolean, Node, string][]} */ ([
    [data.things.length > 0, swatch("var(--thing)"), data.things.length > 1 ? "obstacles" : "obstacle"],
    [data.reference !== null, make("i", { class: "replay-diamond" }), "reference"],
    [has("violation"), swatch("var(--alarm)"), "violation"]]))
    if (drawn) legend.push(make("span", { class: "replay-key" }, sample, text));
  const help = make("div", { class: "replay-help", hidden: "" },
    ...HELP.filter(([,, of]) => !of || has(of) || boxes.has(of)).map(([keys, what]) =>
      make("div", {}, make("kbd", {}, keys), what)));
  const question = button("?", "H", () => { help.hidden = !help.hidden; });
  question.setAttribute("aria-label", "Keys");
  const graph = /** @type {HTMLElement | null} */ (root.querySelector(".replay-graph"));
  const track = make("div", { class: "replay-track" }, ...graph ? [graph] : [], head, scrub);
  const stage = make("div", { class: "replay-stage" }, canvas, names, state, chosen, said, scale, help);
  const panel = make("div",
    { class: "replay-panel", role: "group", "aria-label": "Replay of " + (root.dataset.label ?? "a flight") },
    stage, make("div", { class: "replay-time" }, start, track, clock, question),
    make("div", { class: "replay-buttons" }, ...jumps, ...views, follow, colouring, ...shows.trails ? [tail] : [],
      speeds),
    make("div", { class: "replay-buttons" }, ...legend));
  root.prepend(panel);

  // Time [s]. `queued` is the next frame, `before` the time of the last one while playing [ms].
  let t = first, playing = false, ended = false, queued = 0, before = 0;
  let current = /** @type {Moment | null} */ (null);
  /** Shows the sentence of a moment, or none. @param {Moment | null} moment */
  const announce = moment => { current = moment; write(said, moment?.said ?? ""); };
  /** Picked vehicle. @type {number | null} */
  let picked = null;
  /** Middles of names with half their sizes [px]. @type {number[][]} */
  let labelled = [];
  /** Requests a frame, unless one is queued. */
  const ask = () => { if (!queued && !ended) queued = requestAnimationFrame(frame); };
  /** Plays or pauses. */
  const toggle = () => {
    playing = !playing;
    if (playing && t >= last) t = first;
    write(start, playing ? "Pause" : "Play");
    before = 0;
    announce(null);
    ask();
  };
  /** Pauses and shows a time [s]. @param {number} to */
  const go = to => {
    if (playing) toggle();
    t = clamp(to, first, last);
    announce(null);
    ask();
  };
  /**
   * Jumps to the next moment of a kind (`way` 1) or to the one before (-1), beyond the last one to the first one.
   * @param {string} kind @param {number} way
   */
  const jump = (kind, way) => {
    const all = moments.filter(moment => moment.kind === kind), at = current ? all.indexOf(current) : -1;
    if (!all.length) return;
    const here = upTo(all.map(moment => moment.at_s), t), next = at >= 0 ? at + way : way > 0 ? here : here - 1;
    const moment = all[(next + all.length) % all.length];
    go(moment.at_s);
    announce(moment);
    // The camera shows everything unless it already shows the vehicles of the moment.
    seek();
    const [across, high] = [canvas.clientWidth, canvas.clientHeight], there = moment.who.filter(k => place(k)[3]);
    if (there.map(project).some(([x, y, away]) => away <= 0 || x < 0 || y < 0 || x > across || y > high)) fit();
  };
  /** Draws a frame and, while playing, advances the time. @param {number} now Time of the browser [ms]. */
  const frame = now => {
    queued = 0;
    if (ended) return;
    if (playing) {
      if (before) t += Math.min((now - before) / 1000, 0.1) * +speeds.value;
      before = now;
      if (t >= last) { t = last; toggle(); }
    }
    draw();
    if (playing) ask();
  };

  // The camera looks at `target` [m] from `distance` [m]. Angles are in rad. A parallel view has the scale that a
  // view in perspective has at the target.
  let parallel = false;
  let yaw = 0, pitch = 0, distance = 1, target = [0, 0, 0], kept = { yaw, pitch, distance, target }, fitted = kept;
  // Positions of the vehicles that the camera fits, with the radius around each [m].
  /** @type {number[][]} */
  const cloud = [];
  for (let k = 0, all = times.length * count, by = Math.max(1, Math.floor(all / SAMPLES)); k < all; k += by) {
    const vehicle = k % count, from = (Math.floor(k / count) * wide + vehicle) * 4;
    if (path[from + 3]) cloud.push([path[from], path[from + 1], path[from + 2], Math.max(shell, outer[vehicle])]);
  }
  // Slots, at most as often as SAMPLES allow.
  if (data.axes !== null && !off.has("slots")) for (const [k, { from_s, slots }] of data.formations.entries()) {
    const all = new Float32Array(bytes(slots)), low = Math.max(upTo(times, from_s) - 1, 0);
    const high = upTo(times, data.formations[k + 1]?.from_s ?? Infinity);
    const by = Math.max(1, Math.ceil((high - low) * all.length / 3 / SAMPLES));
    for (let row = low; row < high; row += by) {
      const [middle, ...ends] = [0, 1, 2, 3].map(part => (row * wide + /** @type {number} */ (data.axes) + part) * 4)
        .map(from => path.subarray(from, from + 4));
      for (let slot = 0; middle[3] && slot < all.length; slot += 3) {
        const at = [0, 1, 2].map(axis => ends.reduce((sum, end, part) =>
          sum + (end[axis] - middle[axis]) * all[slot + part] / data.axis_m, middle[axis]));
        cloud.push([...at, least_m]);
      }
    }
  }
  const bounds = [0, 1, 2].map(axis => cloud.reduce(([low, high], at) => [Math.min(low, at[axis]),
    Math.max(high, at[axis])], [Infinity, -Infinity]));
  const from = data.viewpoint;
  /** Directions and projections: perspective, top, front, side. @type {[number, number, boolean][]} */
  const VIEWS = [[from.azimuth_deg * UPRIGHT / 90, from.elevation_deg * UPRIGHT / 90, false],
    [-UPRIGHT, UPRIGHT, true], [-UPRIGHT, 0, true], [0, 0, true]];
  const aspect = () => canvas.clientWidth / canvas.clientHeight || 1;
  /** Moves the camera along its direction and across until all positions of the vehicles fit into the picture. */
  const fit = () => {
    follow.value = "";
    const { right, up, back } = axes(), wide = TANGENT * aspect() * 0.94;
    // Shares of the height above and below the middle; the caption covers the top.
    const covered = shows.caption ? 2 * (state.offsetTop + state.offsetHeight) / (canvas.clientHeight || 1) : 0;
    const [above, below] = [clamp(1 - covered, 0.5, 0.84), 0.84], tall = TANGENT * (above + below) / 2;
    target = bounds.map(([low, high]) => (low + high) / 2);
    for (let turns = 0; turns < 4; turns++) {
      const seen = cloud.map(at => {
        const from = [0, 1, 2].map(axis => at[axis] - target[axis]);
        return [dot(from, right), dot(from, up), dot(from, back), at[3]];
      });
      distance = 0;
      for (const [x, y, z, r] of seen) {
        const ahead = parallel ? 0 : z;
        distance = Math.max(distance, (Math.abs(x) + r) / wide + ahead, (Math.abs(y) + r) / tall + ahead,
          1.01 * r + ahead);
      }
      const middle = [0, 1].map(axis => {
        const places = seen.map(at => at[axis] / (parallel ? distance : distance - at[2]));
        return (Math.max(...places) + Math.min(...places)) / 2 * distance;
      });
      target = target.map((x, k) => x + right[k] * middle[0] + up[k] * middle[1]);
    }
    target = target.map((x, k) => x + up[k] * distance * TANGENT * (below - above) / 2);
    fitted = { yaw, pitch, distance, target };
  };
  /** Distance at which a camera that follows the swarm always shows all of it [m]. */
  const close = () => {
    const [across, high] = [axes().right, axes().up].map(axis => dot(axis.map(Math.abs), data.swarm_m));
    return 1.05 * Math.max(across / aspect() / 0.94, high / 0.84) / TANGENT;
  };
  /** Shows everything in perspective (0), from the top (1), the front (2) or the side (3). @param {number} k */
  const look = k => { [yaw, pitch, parallel] = VIEWS[k]; fit(); ask(); };
  /** Centre of the vehicles that are there [m]. */
  const centre = () => {
    const all = radius.map((_, k) => place(k)).filter(at => at[3]);
    return all.length ? [0, 1, 2].map(axis => all.reduce((sum, at) => sum + at[axis], 0) / all.length) : target;
  };
  /** Moves the camera near what it follows. */
  const approach = () => {
    if (follow.value === "picked") {
      picked ??= 0;
      distance = Math.max(16 * outer[picked], 8 * shell);
    } else if (follow.value === "swarm") distance = close();
  };
  /** How far the eye of a parallel view is moved back [m], so that everything is ahead of it. */
  const behind = () => parallel ? 12 * reach : 0;
  /** Axes of the camera, and its position. */
  const axes = () => {
    const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
    const back = [cp * cy, cp * sy, sp];
    const eye = back.map((x, k) => target[k] + x * (distance + behind()));
    return { right: [-sy, cy, 0], up: [-sp * cy, -sp * sy, cp], back, eye };
  };
  const turn = (/** @type {number} */ by, /** @type {number} */ lift) => {
    yaw += by;
    pitch = clamp(pitch + lift, -UPRIGHT, UPRIGHT);
    ask();
  };
  const zoom = (/** @type {number} */ by) => {
    distance = clamp(distance * by, Math.min(reach * 0.01, 4 * least_m), reach * 20);
    ask();
  };
  const pan = (/** @type {number} */ dx, /** @type {number} */ dy) => {
    follow.value = "";
    const { right, up } = axes(), metres = 2 * TANGENT * distance / canvas.clientHeight;
    target = target.map((x, k) => x - (right[k] * dx - up[k] * dy) * metres);
    ask();
  };
  /** Pointers that are down, by identifier. @type {Map<number, number[]>} */
  const fingers = new Map();
  /** Middle and distance of two fingers [px]. */
  const grip = () => {
    const [a, b] = [...fingers.values()];
    return [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2, Math.hypot(a[0] - b[0], a[1] - b[1]) || 1];
  };
  // Where the pointer went down [px]: a click picks a vehicle.
  let pressed = [0, 0];
  canvas.onpointerdown = event => {
    pressed = [event.clientX, event.clientY];
    if (!fingers.size) kept = { yaw, pitch, distance, target };
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    canvas.setPointerCapture(event.pointerId);
  };
  canvas.onpointermove = event => {
    const from = fingers.get(event.pointerId), old = fingers.size === 2 ? grip() : null;
    if (!from) return;
    const [dx, dy] = [event.clientX - from[0], event.clientY - from[1]], by = 5 / canvas.clientHeight;
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    if (old) {
      const now = grip();
      zoom(old[2] / now[2]);
      pan(now[0] - old[0], now[1] - old[1]);
    } else if (event.buttons & 2 || event.shiftKey) pan(dx, dy); else turn(-dx * by, dy * by);
  };
  canvas.onpointerup = event => {
    fingers.delete(event.pointerId);
    if (Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > 4) return;
    const box = canvas.getBoundingClientRect(), [x, y] = [event.clientX - box.left, event.clientY - box.top];
    let best = 24;
    picked = null;
    for (const vehicle of radius.keys()) {
      const [px, py, away, px_per_m] = project(vehicle), off = Math.hypot(px - x, py - y) - outer[vehicle] * px_per_m;
      if (away > 0 && off < best) [best, picked] = [off, vehicle];
    }
    ask();
  };
  // The browser scrolls the page with this finger: the camera returns to where it was.
  canvas.onpointercancel = event => {
    fingers.delete(event.pointerId);
    ({ yaw, pitch, distance, target } = kept);
    ask();
  };
  canvas.oncontextmenu = event => event.preventDefault();
  // The wheel scrolls the page until the canvas has the focus.
  canvas.addEventListener("wheel", event => {
    if (!event.ctrlKey && document.activeElement !== canvas) return;
    event.preventDefault();
    zoom(Math.exp(clamp(event.deltaY, -100, 100) / 400));
  }, { passive: false });
  const faster = (/** @type {number} */ by) =>
    speeds.selectedIndex = clamp(speeds.selectedIndex + by, 0, SPEEDS.length - 1);
  /** Chooses the next entry of a list. @param {HTMLSelectElement} list */
  const cycle = list => {
    list.selectedIndex = (list.selectedIndex + 1) % list.length;
    list.dispatchEvent(new Event("change"));
  };
  /** Changes the theme of the page. */
  const theme = () => {
    const choice = /** @type {HTMLSelectElement | null} */ (document.querySelector(".theme select"));
    if (!choice) return;
    choice.selectedIndex = (choice.selectedIndex + 1) % choice.length;
    themed();
  };
  /** Saves the picture with its labels. */
  const save = () => {
    draw();
    const sheet = make("canvas", { width: `${canvas.width}`, height: `${canvas.height}` });
    const pen = sheet.getContext("2d");
    for (const part of [canvas, names]) pen.drawImage(part, 0, 0);
    make("a", { href: sheet.toDataURL(), download: `replay-${t.toFixed(data.decimals)}s.png` }).click();
  };
  /** @type {Object<string, (shift: boolean) => void>} */
  const keys = {
    " ": toggle, Home: () => go(first), End: () => go(last), n: () => jump("closest", 1),
    b: shift => jump("violation", shift ? -1 : 1), u: shift => jump("undecided", shift ? -1 : 1),
    1: () => look(0), 2: () => look(1), 3: () => look(2), c: () => cycle(colouring), m: theme,
    l: () => boxes.get("names")?.click(), f: () => {
      if (follow.value) return fit();
      follow.value = picked === null ? "swarm" : "picked";
      approach();
    }, t: () => {
      const box = boxes.get("trails");
      if (!box) return;
      // Whole, short, none.
      if (box.checked && !tail.selectedIndex && tail.length > 1) tail.selectedIndex = 1;
      else { if (!box.checked) tail.selectedIndex = 0; box.click(); }
    },
    v: () => { picked = picked === null ? 0 : picked + 1 < count ? picked + 1 : null; },
    ArrowLeft: shift => go(shift ? t - 1 : [...times].findLast(time => time < t) ?? first),
    ArrowRight: shift => go(shift ? t + 1 : times[upTo(times, t)] ?? last),
    a: () => turn(-0.1, 0), d: () => turn(0.1, 0), w: () => turn(0, 0.1), s: () => turn(0, -0.1),
    PageUp: () => zoom(0.8), PageDown: () => zoom(1.25),
    ArrowUp: () => faster(1), ArrowDown: () => faster(-1),
    "+": () => faster(1), "=": () => faster(1), "-": () => faster(-1),
    p: save, h: () => question.click(), "?": () => question.click(),
  };
  panel.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => {
    const on = /** @type {HTMLElement} */ (event.target);
    const key = event.key.length > 1 ? event.key : event.key.toLowerCase();
    if (event.ctrlKey || event.altKey || event.metaKey || on instanceof HTMLSelectElement
      || key === " " && on !== canvas && on !== scrub || !keys[key]) return;
    event.preventDefault();
    keys[key](event.shiftKey);
    ask();
  });

  // Programs, textures and meshes.
  /** @param {string} vertex @param {string} pixel @returns {Program} */
  const program = (vertex, pixel = vertex) => {
    const made = gl.createProgram();
    for (const [kind, text] of /** @type {[number, string][]} */ ([
      [gl.VERTEX_SHADER, shader(vertex)], [gl.FRAGMENT_SHADER, shader(pixel + "_PIXEL")]])) {
      const part = /** @type {WebGLShader} */ (gl.createShader(kind));
      gl.shaderSource(part, text);
      gl.compileShader(part);
      gl.attachShader(made, part);
    }
    ["from", "to", "pair", "radius"].forEach((name, k) => gl.bindAttribLocation(made, k, name));
    gl.linkProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error("The replay cannot be drawn here.");
    /** @type {Object<string, WebGLUniformLocation>} */
    const at = {};
    for (let k = gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS); k-- > 0;) {
      const name = gl.getActiveUniform(made, k)?.name ?? "", place = gl.getUniformLocation(made, name);
      if (place) at[name] = place;
    }
    return { made, at };
  };
  /**
   * Makes the texture of a unit, with four numbers a texel, or one in the format R32F.
   * @param {number} unit @param {number} format @param {number} across @param {number} high @param {number} kind
   * @param {ArrayBufferView} from
   */
  const texture = (unit, format, across, high, kind, from) => {
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texImage2D(gl.TEXTURE_2D, 0, format, across, high, 0, format === gl.R32F ? gl.RED : gl.RGBA, kind, from);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER])
      gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
  };
  /**
   * Makes a mesh of the attributes at these locations, which alternate in `numbers` with `size` numbers each. They
   * advance with each vertex, or with each copy where `divisor` is 1.
   * @param {number[]} at @param {number} size @param {number} divisor @param {Float32Array} [numbers]
   * @returns {Mesh}
   */
  const mesh = (at, size, divisor, numbers = new Float32Array) => {
    const vao = gl.createVertexArray(), buffer = gl.createBuffer();
    gl.bindVertexArray(vao);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, numbers, gl.DYNAMIC_DRAW);
    at.forEach((name, k) => {
      gl.enableVertexAttribArray(name);
      gl.vertexAttribPointer(name, size, gl.FLOAT, false, 4 * size * at.length, 4 * size * k);
      gl.vertexAttribDivisor(name, divisor);
    });
    return { vao, buffer, count: numbers.length / size / at.length };
  };
  /** Replaces the numbers of a mesh with one attribute of size 3. @param {Mesh} of @param {Float32Array} numbers */
  const refill = (of, numbers) => {
    gl.bindBuffer(gl.ARRAY_BUFFER, of.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, numbers, gl.DYNAMIC_DRAW);
    of.count = numbers.length / 3;
  };
  const ball = program("BALL"), line = program("LINE", "FLAT"), mark = program("MARK");
  const solid = program("SOLID", "FLAT"), rotor = rotors ? program("ROTOR") : null;
  texture(0, gl.RGBA32F, wide, times.length, gl.FLOAT, path);
  // Rows of colours: present ones, with alpha 0 for a vehicle in violation, and those of the vehicles themselves.
  const paint = new Uint8Array(count * 8).fill(255);
  texture(1, gl.RGBA8, count, 2, gl.UNSIGNED_BYTE, paint);
  texture(2, gl.R32F, 1, 1, gl.FLOAT, new Float32Array(1));
  texture(3, gl.RGBA32F, rotors ? count : 1, rotors ? times.length : 1, gl.FLOAT, turned);
  const arms = rotors?.ends_m.flat() ?? new Array(15).fill(0);
  const bodies = mesh([3], 1, 1, Float32Array.from(radius, of => rotors?.body_m ?? of));
  const shells = mesh([3], 1, 1, Float32Array.from(radius)), slots = mesh([0], 3, 1);
  const links = mesh([2], 3, 1), pairs = mesh([2], 3, 1);
  const ground = mesh([0, 1], 3, 1);
  const things = data.things.map(({ solid, rims, ...rest }) => ({ ...rest,
    solid: mesh([0, 1], 3, 0, new Float32Array(bytes(solid))),
    rims: mesh([0, 1], 3, 1, new Float32Array(bytes(rims))) }));
  gl.bindVertexArray(null);
  // Pieces of trails within violations: both ends [m], and times from the start [s].
  /** @type {number[]} */
  const wrongs = [];
  for (const { kind, who, from_s, to_s } of moments) if (kind === "violation") for (const k of who)
    for (let row = Math.max(upTo(times, from_s) - 1, 0); row + 1 < times.length && times[row] < to_s; row++) {
      const [a, b] = [(row * wide + k) * 4, ((row + 1) * wide + k) * 4], long = times[row + 1] - times[row];
      if (path[a + 3] !== path[b + 3] || !path[a + 3] || wrongs.length > 9 * RED) continue;
      const ends = [from_s, to_s].map(end => clamp((end - times[row]) / long, 0, 1));
      for (const part of ends) wrongs.push(...mix(path.subarray(a), path.subarray(b), part));
      wrongs.push(...ends.map(part => times[row] - first + part * long), 0);
    }
  const reds = mesh([0, 1, 2], 3, 1, Float32Array.from(wrongs));
  gl.bindVertexArray(null);

  // Drawing. The time lies between the instants `row` and `next`, at the share `part` of the interval. `painted` lists
  // the vehicles in red, `shape` is the number of the formation in the meshes.
  const dark = matchMedia("(prefers-color-scheme: dark)");
  let painted = "", shape = -1, lit = false, row = 0, next = 0, part = 0, near = /** @type {number[]} */ ([]);
  /** Colours by name. @type {Object<string, number[]>} */
  let colours = {};
  /** Colours of quantities from the smallest to the largest number. */
  let ramp = QUANTITIES;
  /** Smallest and largest number of the colour scale; equal where vehicles have colours of their own. */
  let spanned = [0, 0];
  /** Applies the colours of the page. */
  const themed = () => {
    painted = "?";
    const numbers = (/** @type {string} */ name) => {
      canvas.style.color = `var(--${name})`;
      const found = getComputedStyle(canvas).color, scaled = found.startsWith("color(") ? 255 : 1;
      return (found.match(/[\d.]+/g) ?? []).slice(0, 3).map(part => Math.round(+part * scaled));
    };
    colours = Object.fromEntries(COLOURS.map(name => [name, numbers(name)]));
    ask();
  };
  /** Distance of each vehicle to its nearest neighbour at an instant, beyond the safety distance [m]. */
  const clearances = (/** @type {number} */ row) => {
    const at = (/** @type {number} */ k) => (row * wide + k) * 4;
    const there = [...radius.keys()].filter(k => path[at(k) + 3]).sort((a, b) => path[at(a)] - path[at(b)]);
    // Vertical lengths are scaled to the ellipsoid.
    const high = data.shell_m ? data.shell_m[0] / data.shell_m[2] : 1, least = new Float32Array(count).fill(Infinity);
    // Neighbours are sought in the order of x, up to the nearest so far.
    for (let i = 0; i < there.length; i++) for (const way of [-1, 1]) for (let j = i + way; there[j] >= 0; j += way) {
      const a = there[i], [x, y, z] = [0, 1, 2].map(axis => path[at(there[j]) + axis] - path[at(a) + axis]);
      if (Math.abs(x) >= least[a]) break;
      least[a] = Math.min(least[a], Math.hypot(x, y, z * high));
    }
    return least.map(of => of - 2 * (data.shell_m?.[0] ?? 0));
  };
  /** Speed of each vehicle at an instant [m/s], of the interval behind it, or before the last one. */
  const speedsAt = (/** @type {number} */ row) => {
    if (stated) return stated.subarray(row * count, (row + 1) * count);
    const [a, b] = row + 1 < times.length ? [row, row + 1] : [Math.max(row - 1, 0), row];
    return Float32Array.from(radius, (_, k) => {
      const [from, to] = [(a * wide + k) * 4, (b * wide + k) * 4], long = times[b] - times[a];
      return path[from + 3] !== path[to + 3] || !(long > 0) ? 0
        : Math.hypot(...[0, 1, 2].map(axis => path[to + axis] - path[from + axis])) / long;
    });
  };
  const inWords = (/** @type {number} */ speed) => Number.isNaN(speed) ? "speed not known" : speed.toFixed(2) + " m/s";
  /** Colours vehicles and trails by what is chosen. */
  const recolour = () => {
    const kind = colouring.value, at = kind === "speed" ? speedsAt : clearances;
    spanned = [0, 0];
    scale.replaceChildren();
    lit = kind === "lights";
    stage.style.colorScheme = lit ? "dark" : "";
    themed();
    if (!kind || lit) return;
    const numbers = new Float32Array(times.length * count);
    for (let row = 0; row < times.length; row++) numbers.set(at(row).map(x => x || 0), row * count);
    const high = kind === "speed" ? numbers.reduce((most, x) => Math.max(most, x), 1e-9) : data.clearance_m;
    gl.deleteTexture(gl.getParameter((gl.activeTexture(gl.TEXTURE2), gl.TEXTURE_BINDING_2D)));
    texture(2, gl.R32F, count, times.length, gl.FLOAT, numbers);
    spanned = [0, high];
    ramp = kind === "speed" ? QUANTITIES : [...QUANTITIES].reverse();
    scale.append(kind + " 0.00", swatch(`linear-gradient(90deg,${ramp.map(name => `var(--${name})`)})`),
      `${high.toFixed(2)} ${kind === "speed" ? "m/s" : "m"}`);
  };
  /**
   * Fits a canvas to its size on the page. Returns device pixels per CSS pixel, 0 for a canvas without a size.
   * @param {HTMLCanvasElement} of
   */
  const sizeOf = of => {
    const ratio = Math.min(devicePixelRatio || 1, 2);
    const [across, high] = [Math.round(of.clientWidth * ratio), Math.round(of.clientHeight * ratio)];
    if (of.width !== across || of.height !== high) [of.width, of.height] = [across, high];
    return across && high ? ratio : 0;
  };
  /** Finds the instants around the time. */
  const seek = () => {
    row = clamp(upTo(times, t) - 1, 0, times.length - 1);
    next = Math.min(row + 1, times.length - 1);
    part = next > row && !data.holds ? clamp((t - times[row]) / (times[next] - times[row]), 0, 1) : 0;
  };
  /** Position of a point from the origin [m], and 1 where it is there, else 0. @param {number} k */
  const place = k => {
    const [a, b] = [(row * wide + k) * 4, (next * wide + k) * 4];
    return mix(path.subarray(a), path.subarray(b), part)
      .concat(path[a + 3] && (part <= 0 || path[a + 3] === path[b + 3]) ? 1 : 0);
  };
  /** Place of a vehicle in the picture [CSS px], its depth [m], or 0 where it is absent, and pixels per metre. */
  const project = (/** @type {number} */ k) => {
    const [x, y, z, there] = place(k), { right, up, back, eye } = axes();
    const from = [x - eye[0], y - eye[1], z - eye[2]], [across, above, ahead] = [right, up, back].map(axis =>
      dot(from, axis));
    const [wide, high] = [canvas.clientWidth, canvas.clientHeight];
    const scale = high / 2 / TANGENT / (parallel ? distance : -ahead);
    return [wide / 2 + across * scale, high / 2 - above * scale, there ? -ahead : 0, scale];
  };
  /** Position of an obstacle from the origin [m]. @param {number[][]} way */
  const thingAt = way => {
    const k = clamp(upTo(way.map(point => point[0]), t), 0, way.length - 1);
    const [a, b] = [way[Math.max(k - 1, 0)], way[k]];
    const share = b[0] > a[0] ? clamp((t - a[0]) / (b[0] - a[0]), 0, 1) : 1;
    return mix(a.slice(1), b.slice(1), share).map((x, axis) => x - data.origin_m[axis]);
  };
  /** Fills the meshes of slots and links for the formation of this time. A link has its length in the formation [m]. */
  const reform = () => {
    const now = upTo(data.formations.map(of => of.from_s), t);
    if (now === shape) return;
    const at = new Float32Array(bytes(data.formations[now - 1]?.slots ?? ""));
    const ends = new Uint16Array(bytes(data.links)), joined = [];
    shape = now;
    refill(slots, at);
    for (let k = 0; k < ends.length; k += 2) {
      const [a, b] = [3 * ends[k], 3 * ends[k + 1]];
      joined.push(ends[k], ends[k + 1],
        Math.hypot(at[a] - at[b], at[a + 1] - at[b + 1], at[a + 2] - at[b + 2]) || 0);
    }
    refill(links, Float32Array.from(joined));
  };
  /**
   * Fills the ground. In a parallel view its squares reach the edges of the picture.
   * @param {number[]} right @param {number[]} up @param {number} aspect
   */
  const fill = (right, up, aspect) => {
    const side = data.square_m, [least, most] = data.ground, ends = [0, 1].map(axis => {
      const low = least[axis], high = most[axis], across = Math.abs(right[axis]) * aspect + Math.abs(up[axis]);
      const by = !parallel ? 0 : TANGENT * distance * across;
      const more = (/** @type {number} */ gap) => clamp(Math.ceil(gap / side), 0, 99) * side;
      return by < 1e-3 * distance ? [low, high]
        : [low - more(low - target[axis] + by), high + more(target[axis] + by - high)];
    });
    const numbers = [];
    for (const axis of [0, 1]) for (let at = ends[axis][0]; at < ends[axis][1] + side / 2; at += side)
      for (const end of ends[1 - axis]) numbers.push(...axis ? [end, at] : [at, end], least[2]);
    refill(ground, Float32Array.from(numbers));
    ground.count = numbers.length / 6;
  };
  /** Colour of a light at a part of the width of the swarm. @param {number} at */
  const light = at => {
    const part = clamp(at, 0, 1) * 2.999, k = Math.floor(part);
    return mix(colours[LIGHTS[k]], colours[LIGHTS[k + 1]], part - k).map(Math.round);
  };
  const draw = () => {
    const ratio = sizeOf(canvas);
    if (!ratio || ended) return;
    seek();
    if (follow.value === "swarm") target = centre();
    else if (follow.value === "picked" && picked !== null && place(picked)[3]) target = place(picked).slice(0, 3);
    const size = [canvas.width, canvas.height], { right, up, back, eye } = axes();
    const lens = [TANGENT * size[0] / size[1], TANGENT, distance * 0.02, distance + behind() + reach * 12];
    // Violations of this time, and their vehicles.
    const [, alarm, verdict, named, thing] = latest(data.verdicts, t) ?? [0, false, "", [], null];
    const wrong = [...moments.filter(of => of.kind === "violation" && of.from_s <= t && t <= of.to_s),
      { who: named, thing }];
    const who = new Set(wrong.flatMap(of => of.who));
    if (lit || [...who].join() !== painted) {
      painted = lit ? "?" : [...who].join();
      const across = lit ? [...radius.keys()].map(k => project(k)[0]) : [], low = Math.min(...across);
      const reach = Math.max(...across) - low || 1;
      for (let k = 0; k < count; k++) {
        const own = lit ? light((across[k] - low) / reach) : colours[`c${count <= limits.colours ? k % 8 + 1 : 1}`];
        paint.set(who.has(k) ? [...colours.alarm, 0] : [...own, 255], 4 * k);
        paint.set([...own, 255], 4 * (count + k));
      }
      gl.activeTexture(gl.TEXTURE1);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, count, 2, gl.RGBA, gl.UNSIGNED_BYTE, paint);
    }
    reform();
    gl.viewport(0, 0, size[0], size[1]);
    gl.clearColor(...(/** @type {[number, number, number, number]} */ (rgba(lit ? colours.night : colours.sky))));
    gl.enable(gl.DEPTH_TEST);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    /** Sets uniforms of the current program by name. @type {(values: Object<string, number | number[]>) => void} */
    let set = () => {};
    /**
     * Makes a program the current one and sets its uniforms.
     * @param {Program} of @param {Object<string, number | number[]>} values
     */
    const use = ({ made, at }, values) => {
      gl.useProgram(made);
      set = given => {
        for (const name in given) {
          const to = at[name], value = given[name];
          if (!to) continue;
          if (typeof value === "number") { if (WHOLE.has(name)) gl.uniform1i(to, value); else gl.uniform1f(to, value); }
          else if (value.length === 2) gl.uniform2fv(to, value);
          else if (value.length === 4) gl.uniform4fv(to, value); else gl.uniform3fv(to, value);
        }
      };
      set({ right, up, back, eye, lens, size, parallel: parallel ? distance : 0, path: 0, paint: 1, value: 2, turn: 3,
        row, next, part, level: data.ground[0][2], points: count, spanned, light: data.light,
        "ramp[0]": ramp.flatMap(name => rgba(colours[name]).slice(0, 3)), arm, armLeast: 8 * ratio,
        "arms[0]": arms, shell: [0, 0, 0], offset: [0, 0, 0], fixedAt: [0, 0, 0, 0], fixedPaint: [0, 0, 0, 0],
        ...values });
    };
    /** Draws copies of a quad. @param {Mesh | null} of @param {number} [copies] */
    const quads = (of, copies = of?.count ?? 0) => {
      gl.bindVertexArray(of?.vao ?? null);
      if (copies > 0) gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, copies);
    };
    const hit = new Set(wrong.map(of => of.thing));
    const solids = (/** @type {boolean} */ opaque) => things.forEach((thing, k) => {
      const plane = thing.opacity < 1, offset = thingAt(thing.path);
      const colour = hit.has(k) ? colours.alarm : plane ? colours.floor : colours.thing;
      if (thing.radius_m !== null && opaque) {
        use(ball, { fixedAt: [...offset, thing.radius_m], fixedPaint: rgba(colour) });
        quads(null, 1);
      } else if (thing.opacity === 1 === opaque) {
        use(solid, { offset, tint: rgba(colour, thing.opacity) });
        gl.bindVertexArray(thing.solid.vao);
        // Rims are in front of the sides.
        gl.enable(gl.POLYGON_OFFSET_FILL);
        gl.polygonOffset(1, 2);
        gl.drawArrays(gl.TRIANGLES, 0, thing.solid.count);
        gl.disable(gl.POLYGON_OFFSET_FILL);
        const rim = plane ? rgba(colour, 2 * thing.opacity) : rgba(colour.map(part => 0.4 * part));
        use(line, { offset, kind: 0, width: 1.4 * ratio, tint: rim });
        quads(thing.rims);
      }
    });

    // Opaque objects, then lines and transparent objects, which write no depth.
    gl.depthMask(true);
    gl.disable(gl.BLEND);
    gl.enable(gl.SAMPLE_ALPHA_TO_COVERAGE);
    use(ball, { least: 2 * ratio });
    quads(bodies);
    solids(true);
    gl.disable(gl.SAMPLE_ALPHA_TO_COVERAGE);
    gl.enable(gl.BLEND);
    gl.depthMask(false);
    use(line, { kind: 0, width: ratio, tint: rgba(colours.floor) });
    if (shows.ground) {
      fill(right, up, size[0] / size[1]);
      quads(ground);
    }
    // Lines down to the ground and marks there, unless the vehicles hide them.
    const drops = shows.ground && pitch < 1.3 && count <= limits.drops ? count : 0;
    if (drops) {
      use(mark, { mark: 2, size_m: least_m, least: 3 * ratio, tint: [0, 0, 0, 0.6] });
      quads(null, drops);
      use(line, { kind: 5, width: 1.1 * ratio, tint: rgba(colours.rest, 0.55) });
      quads(null, drops);
    }
    if (shows.trails) {
      const tailed = +tail.value;
      let stride = 1;
      while (row / stride > clamp(Math.floor(TRAIL_PIECES / count), 2, 400)) stride *= 2;
      set({ kind: 2, width: (count < 50 ? 2 : 1.3) * ratio, stride, newest: row - row % stride, now: t - first,
        fading: Math.max(Math.min(0.25 * span, tailed), 1e-9), tail: Math.min(tailed, 1e30) });
      quads(null, count * (Math.floor(row / stride) + 1));
      set({ kind: 3, width: 3 * ratio, tint: rgba(colours.alarm) });
      quads(reds);
    }
    set({ kind: 1, width: data.link_look[0] * ratio, delta: data.tension ? data.delta_m : -1,
      tint: [0, 0, 0, 0], push: rgba(colours.push), pull: rgba(colours.pull),
      rest: rgba(colours.rest, data.link_look[1]) });
    if (shows.links) quads(links);
    // Lines of the closest pair, as the page's data names it, and of all pairs in violation.
    const k = 2 * upTo(nearS, t) - 2, slice = [nearWho[k], nearWho[k + 1]].filter(vehicle => vehicle < count);
    const closest = near = current?.kind === "closest" && current.who.length === 2 ? current.who : slice;
    for (const [two, colour, width] of /** @type {[number[][], number[], number][]} */ ([
      [shows.closest ? [closest] : [], colours.ink, 2.6], [wrong.map(of => of.who), colours.alarm, 5]])) {
      set({ tint: rgba(colour), width: width * ratio });
      refill(pairs, Float32Array.from(two.filter(pair => pair.length === 2).flatMap(pair => [...pair, 0])));
      quads(pairs);
    }
    if (shows.slots && data.axes !== null) {
      // Axes that jump between two instants are not interpolated.
      const from = (row * wide + data.axes + 1) * 4, to = (next * wide + data.axes + 1) * 4;
      const jumps = [...path.subarray(from, from + 12)].some((x, at) =>
        Math.abs(x - path[to + at]) > 0.4 * data.axis_m);
      const laid = { axis: data.axes, part: jumps ? 0 : part, length_m: data.axis_m };
      use(line, { ...laid, kind: 6, width: 1.1 * ratio });
      quads(slots);
      use(mark, { ...laid, mark: 0, size_m: 1.45 * least_m,
        least: 4 * ratio, stroke: 0.8 * ratio, tint: [0, 0, 0, count < 200 ? 0.85 : 0.45] });
      quads(slots);
    }
    if (data.reference !== null && !lit) {
      use(mark, { axis: data.reference, mark: 1, least: 7 * ratio, stroke: 0.8 * ratio, tint: rgba(colours.ink) });
      quads(null, 1);
    }
    if (rotor) {
      use(line, { kind: 4, width: 2.2 * ratio, tint: rgba(colours.ink) });
      quads(null, 5 * count);
      use(rotor, { rotor: rotors?.rotor_m ?? 0 });
      quads(null, 4 * count);
    }
    const glow_m = Math.max(4 * least_m, 1.9 * shell), width_px = canvas.clientWidth;
    if (lit) for (const [kind, size_m, least] of [[3, glow_m, Math.min(15, width_px / 50)],
      [4, 0.6 * glow_m, Math.min(9, width_px / 80)]]) {
      use(mark, { mark: kind, size_m, least: least * ratio, lift: 1.1 * least_m, tint: [...rgba(colours.ink)] });
      quads(null, count);
    }
    if (picked !== null) {
      const at = place(picked);
      use(ball, { shell: new Array(3).fill(Math.max(1.5 * outer[picked], 9 * ratio * 2 * TANGENT * distance / size[1])),
        fixedAt: at, fixedPaint: rgba(colours.ink, 0.9) });
      if (at[3]) quads(null, 1);
    }
    solids(false);
    // The order of shells of one colour does not matter. Those of vehicles in violation come last.
    if (data.shell_m) {
      use(ball, { shell: data.shell_m, fixedPaint: rgba(colours.shell, 0.6) });
      if (shows.shells) quads(shells);
      for (const at of [...who].map(place).filter(at => at[3])) {
        set({ fixedAt: at, fixedPaint: rgba(colours.alarm, 0.85) });
        quads(null, 1);
      }
    }
    gl.depthMask(true);

    // Labels, on the second canvas.
    const pen = names.getContext("2d");
    if (pen && sizeOf(names)) {
      pen.clearRect(0, 0, names.width, names.height);
      pen.font = `${12 * ratio}px system-ui, sans-serif`;
      [pen.textAlign, pen.lineJoin, pen.lineWidth] = ["center", "round", 3 * ratio];
      pen.strokeStyle = css(colours.sky);
      // Important vehicles come first, then near ones. A name that would cover another one moves or is left out.
      const urgent = new Set([...picked === null ? [] : [picked], ...closest, ...who]);
      const wanted = !shows.names ? [] : [...count <= limits.named ? radius.keys() : urgent].map(vehicle =>
        ({ vehicle, seen: project(vehicle) })).filter(({ seen }) => seen[2] > lens[2]);
      wanted.sort((a, b) => +urgent.has(b.vehicle) - +urgent.has(a.vehicle) || a.seen[2] - b.seen[2]);
      const depths = wanted.map(({ seen }) => seen[2]), nearest = Math.min(...depths), far = Math.max(...depths);
      /** @type {number[][]} */
      const taken = [];
      labelled = taken;
      for (const { vehicle, seen: [x, y, away, px_per_m] } of wanted) {
        const text = data.vehicles[vehicle], half = pen.measureText(text).width / 2 + 2 * ratio, high = 7 * ratio;
        const off = Math.max(outer[vehicle] * px_per_m * ratio, 3 * ratio) + high + 2 * ratio;
        const free = [[0, -off], [0, off], [off + half - high, 0], [high - off - half, 0]]
          .map(([dx, dy]) => [x * ratio + dx, y * ratio + dy]).find(([px, py]) => taken.every(of =>
            Math.abs(of[0] - px) > of[2] + half || Math.abs(of[1] - py) > of[3] + high));
        if (!free) continue;
        taken.push([...free, half, high]);
        pen.globalAlpha = urgent.has(vehicle) || far - nearest < 0.2 * far ? 1
          : 1 - 0.6 * (away - nearest) / (far - nearest);
        pen.fillStyle = css(who.has(vehicle) ? colours.alarm : colours.ink);
        pen.strokeText(text, free[0], free[1] + 4 * ratio);
        pen.fillText(text, free[0], free[1] + 4 * ratio);
      }
      pen.globalAlpha = 1;
    }
    const time = t.toFixed(data.decimals);
    write(state, [verdict, latest(data.nearest, t)?.[1]].filter(words => words).join(" · "));
    state.hidden = !shows.caption;
    const there = picked !== null && place(picked)[3];
    write(chosen, picked === null ? "" : `vehicle ${data.vehicles[picked]} · `
      + (there ? data.holds ? "present" : inWords(speedsAt(row)[picked]) : "absent"));
    state.classList.toggle("replay-alarm", alarm);
    write(clock, time + " s");
    scrub.value = t;
    scrub.setAttribute("aria-valuetext", `${time} of ${last.toFixed(data.decimals)} seconds`);
    head.style.left = `${100 * (t - first) / (span || 1)}%`;
  };
  canvas.addEventListener("webglcontextlost", () => {
    if (!ended) lose(root, "The graphics were lost. Start the replay again.");
  });
  dark.addEventListener("change", themed);
  document.addEventListener("change", themed);
  // A camera as `fit` left it fits again. Any other one keeps what it shows along the shorter side.
  const narrow = () => Math.min(aspect(), 1);
  let narrowed = narrow();
  const sized = new ResizeObserver(() => {
    const before = narrowed, alike = yaw === fitted.yaw && pitch === fitted.pitch && distance === fitted.distance;
    narrowed = narrow();
    if (alike && target === fitted.target) fit(); else distance *= before / narrowed;
    draw();
  });
  sized.observe(stage);
  if (data.lights) {
    colouring.value = "lights";
    recolour();
  }
  themed();
  look(from.across === null ? 0 : 3 - from.across);
  // The camera follows lights, and a swarm that travels far.
  if (data.lights || data.follows) [follow.value, distance] = ["swarm", close()];
  const violation = moments.find(moment => moment.kind === "violation");
  if (root.dataset.opens === "violation" && violation) {
    go(violation.at_s);
    announce(violation);
  }
  return {
    root, draw,
    /** What is drawn, for tests: camera, places [CSS px], boxes around names [px], picked vehicle, arm [m]. */
    seen: () => ({ yaw, pitch, parallel, closest: near, picked, boxes: labelled, names: shows.names, arm,
      places: [...radius.keys()].map(project).filter(at => at[2] > 0) }),
    /**
     * Draws a view at once, for tests: angles in rad, lengths in m, the time in s. Returns the camera.
     * @param {{yaw: number, pitch: number, distance: number, target: number[], t: number, parallel?: boolean}} view
     */
    look(view) {
      ({ yaw, pitch, distance, target, parallel = false } = view);
      follow.value = "";
      t = view.t;
      draw();
      return { ...axes(), tangent: TANGENT, place };
    },
    /**
     * Appends an instant to a live view and drops the oldest one: x, y, z [m] and 1 or 0 for each vehicle, speeds [m/s]
     * or NaN, the time since the last instant [s], the verdict and the closest pair. The newest instant keeps its time.
     * @param {number[]} places @param {number[]} speeds @param {number} long_s @param {Verdict} verdict
     * @param {number[]} pair
     */
    push(places, speeds, long_s, verdict, pair) {
      times.copyWithin(0, 1);
      times.forEach((time, row) => { times[row] = row + 1 < times.length ? time - long_s : last; });
      stated?.copyWithin(0, count);
      stated?.set(speeds, (times.length - 1) * count);
      path.copyWithin(0, 4 * wide);
      path.set(places, (times.length - 1) * wide * 4);
      times.forEach((time, row) => { path[((row + 1) * wide - 1) * 4] = time - first; });
      gl.activeTexture(gl.TEXTURE0);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, wide, times.length, gl.RGBA, gl.FLOAT, path);
      data.verdicts = [verdict];
      nearWho.set(pair);
      if (colouring.value) recolour();
      ask();
    },
    end() {
      ended = true;
      cancelAnimationFrame(queued);
      sized.disconnect();
      dark.removeEventListener("change", themed);
      document.removeEventListener("change", themed);
      if (graph) root.append(graph);
      panel.remove();
      gl.getExtension("WEBGL_lose_context")?.loseContext();
    },
  };
};

/** The only player: browsers limit the number of contexts. @type {ReturnType<typeof play> | null} */
let live = null;
/** Starts the player of a replay in place of the current one. @param {HTMLElement} root */
const open = root => {
  const old = live;
  live = null;
  old?.end();
  if (old && old.root !== root) offer(old.root);
  root.querySelectorAll(".replay-start, .replay-none").forEach(old => old.remove());
  try {
    live = play(root, JSON.parse(root.querySelector("script")?.textContent ?? ""));
    Object.assign(root, { player: live });
  } catch (error) {
    none(root, error instanceof Error ? error.message : String(error));
  }
  root.dataset.state = live ? "ready" : "none";
};
/** Says why there is no replay. @param {HTMLElement} root @param {string} why */
const none = (root, why) => root.prepend(make("p", { class: "replay-none" }, why));
/** Ends the player and offers to start it again. @param {HTMLElement} root @param {string} why */
const lose = (root, why) => {
  live?.end();
  live = null;
  offer(root);
  none(root, why);
  root.dataset.state = "none";
};
/** Adds the button that starts a replay. @param {HTMLElement} root */
const offer = root => {
  const start = make("button", { type: "button", class: "replay-start",
    "aria-label": "Replay this flight: " + (root.dataset.label ?? "") });
  start.onclick = () => { open(root); root.querySelector("canvas")?.focus(); };
  (root.querySelector(".replay-still") ?? root).prepend(start);
};
for (const root of /** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll(".replay")))
  if (root.dataset.start) offer(root); else open(root);
})();
