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
 * @typedef {{name: string, radius_m: number | null, solid: Packed, rims: Packed, opacity: number,
 *   path: number[][]}} Thing
 */
/**
 * Verdict from a time [s] on: time, whether it is a violation, its sentence, vehicles and obstacle of the violation.
 * @typedef {[number, boolean, string, number[], number | null]} Verdict
 */
/**
 * Data of a page: struct `Data` in crates/report/src/replay/data.rs says more.
 * @typedef {{vehicles: string[], radius_m: number[], shell_m: number[] | null, times_s: Packed, middle_m: number[],
 *   origin_m: number[], look_m: number[], half_m: number[], cell_m: number, points: number, starts: Packed,
 *   steps: Packed, breaks: Packed, near_s: Packed, near_who: Packed, holds: boolean, nearest: [number, string][],
 *   verdicts: Verdict[], decimals: number, moments: Moment[], things: Thing[], ground: Packed, square_m: number,
 *   links: Packed, tension: boolean, delta_m: number, formations: {from_s: number, slots: Packed}[], axis_m: number,
 *   axes: number | null, reference: number | null}} Data
 */
/** @typedef {{vao: WebGLVertexArrayObject | null, count: number, buffer: WebGLBuffer | null}} Mesh */
/** @typedef {{made: WebGLProgram, at: Object<string, WebGLUniformLocation>}} Program */

// A step of ABSENT along x marks a point that is not there. TANGENT is that of half the camera's angle of view. At most
// NAMED vehicles are all labelled.
const ABSENT = -32768, TRAIL_PIECES = 24000, TANGENT = 0.36, NAMED = 64;
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8, 16, 32, 64];
// Uniforms that are integers.
const WHOLE = new Set(["path", "paint", "row", "next", "points", "kind", "stride", "newest", "axis", "mark"]);
// Colours of sRGB.
const LIGHT = { paper: 0xeceff3, ink: 0x1b222b, grid: 0xcbd2da, shell: 0x5c7fa3, thing: 0x8a6d3b, alarm: 0xd40014,
  push: 0xd96b00, rest: 0xa6aeb7, pull: 0x125fc4,
  vehicles: [0x0072b2, 0xd55e00, 0x00936c, 0xb85f95, 0x9a7600, 0x7d858e] };
const DARK = { paper: 0x14191f, ink: 0xe6eaef, grid: 0x2e3742, shell: 0x8fb4d9, thing: 0xb8a078, alarm: 0xff2f3c,
  push: 0xff9e2c, rest: 0x6b7580, pull: 0x4fa3ff,
  vehicles: [0x56a8e0, 0xf07f2e, 0x2fbf94, 0xdb8dbb, 0xcba42b, 0xa5adb6] };

const bytes = (/** @type {Packed} */ packed) => Uint8Array.from(atob(packed), letter => letter.charCodeAt(0)).buffer;
/** @param {number} colour @param {number} [alpha] */
const rgba = (colour, alpha = 1) => [(colour >> 16) / 255, (colour >> 8 & 255) / 255, (colour & 255) / 255, alpha];
const css = (/** @type {number} */ colour) => "#" + colour.toString(16).padStart(6, "0");
/** @param {number} x @param {number} low @param {number} high */
const clamp = (x, low, high) => Math.min(Math.max(x, low), high);
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
  const { radius_m: radius, moments } = data, least_m = Math.min(...radius);
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
        const there = steps[step] !== ABSENT, breaking = breaks[broken] === row && breaks[broken + 1] === k;
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
  }

  // Elements.
  const canvas = /** @type {HTMLCanvasElement} */ (make("canvas", {
    class: "replay-view", tabindex: "0", role: "img",
    "aria-label": "Flight in 3-D. W, A, S and D rotate, Page Up and Page Down zoom, Space plays, arrows step." }));
  const gl = /** @type {WebGL2RenderingContext} */ (canvas.getContext("webgl2", { alpha: false, antialias: true }));
  if (!gl) throw new Error("This browser does not draw WebGL 2: there is no replay. Pictures and figures are below.");
  const names = /** @type {HTMLCanvasElement} */ (make("canvas", { class: "replay-names", "aria-hidden": "true" }));
  const state = make("p", { class: "replay-state" });
  const rate = make("p", { class: "replay-rate", title: "frames a second, script time of each" });
  const said = make("p", { class: "replay-said", role: "status" }), clock = make("output", { class: "replay-clock" });
  const head = make("i", { class: "replay-head" });
  const button = (/** @type {string} */ text, /** @type {string} */ keys, /** @type {() => void} */ act) =>
    Object.assign(make("button", { type: "button", "aria-keyshortcuts": keys }, text), { onclick: act });
  const start = Object.assign(button("Play", "Space", () => toggle()), { className: "replay-play" });
  const scrub = make("input", { type: "range", min: `${first}`, max: `${last}`, step: "any", "aria-label": "Time" });
  scrub.oninput = () => go(+scrub.value);
  const speeds = make("select", { "aria-label": "Speed" },
    ...SPEEDS.map(x => make("option", { value: `${x}` }, "× " + x)));
  // Real time unless the flight would then take more than 30 s.
  speeds.value = SPEEDS.find(x => (last - first) / x <= 30) ?? 64;
  const jumps = /** @type {[string, string, string, number][]} */ ([
    ["Closest approach", "C", "closest", 1], ["Previous violation", "Shift+V", "violation", -1],
    ["Next violation", "V", "violation", 1], ["Next undecided", "U", "undecided", 1]])
    .filter(([,, kind]) => moments.some(moment => moment.kind === kind))
    .map(([text, keys, kind, way]) => button(text, keys, () => jump(kind, way)));
  jumps.push(button("Show all", "F", () => { home(); ask(); }));
  /** @type {Object<string, boolean>} */
  const shows = { shells: !!data.shell_m, links: !!data.links, trails: !data.holds, slots: data.axes !== null,
    names: true };
  const layers = Object.keys(shows).filter(name => shows[name]).map(name => {
    const box = make("input", { type: "checkbox", checked: "" });
    box.onchange = () => { shows[name] = box.checked; ask(); };
    return make("label", {}, box, name);
  });
  const graph = root.querySelector("svg");
  const track = make("div", { class: "replay-track" }, ...graph ? [graph, head] : [], scrub);
  const stage = make("div", { class: "replay-stage" }, canvas, names, state, rate);
  const panel = make("div",
    { class: "replay-panel", role: "group", "aria-label": "Replay of " + (root.dataset.label ?? "a flight") },
    stage, make("div", { class: "replay-time" }, start, track, clock), said,
    make("div", { class: "replay-buttons" }, ...jumps, speeds, ...layers));
  root.prepend(panel);
  if (graph) graph.onpointerdown = event => go(first + (last - first) * event.offsetX / graph.clientWidth);

  // Time [s]. `frames` were drawn in `passed` ms; the script took `spent` ms of them. `queued` is the next frame.
  let t = first, playing = false, ended = false, queued = 0, before = 0, frames = 0, passed = 0, spent = 0;
  let current = /** @type {Moment | null} */ (null);
  /** Shows the sentence of a moment, or none. @param {Moment | null} moment */
  const announce = moment => { current = moment; write(said, moment?.said ?? ""); };
  /** Requests a frame, unless one is queued. */
  const ask = () => { if (!queued && !ended) queued = requestAnimationFrame(frame); };
  /** Plays or pauses. */
  const toggle = () => {
    playing = !playing;
    if (playing && t >= last) t = first;
    write(start, playing ? "Pause" : "Play");
    before = frames = passed = spent = 0;
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
    // The camera turns to the vehicles of the moment.
    seek();
    const [a, b = a] = moment.who.map(place).filter(at => at[3]);
    if (!a) return;
    target = [0, 1, 2].map(axis => (a[axis] + b[axis]) / 2);
    distance = Math.min(distance, 40 * (Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]) + least_m));
  };
  /** Draws a frame and, while playing, advances the time. @param {number} now Time of the browser [ms]. */
  const frame = now => {
    queued = 0;
    if (ended) return;
    if (playing) {
      if (before) {
        passed += now - before;
        frames++;
        t += Math.min((now - before) / 1000, 0.1) * +speeds.value;
      }
      // The page was hidden: the interval measures nothing.
      if (now - before > 1000) passed = frames = spent = 0;
      before = now;
      if (passed > 500) {
        [root.dataset.fps, root.dataset.scriptMs] = [(1000 * frames / passed).toFixed(0), (spent / frames).toFixed(2)];
        write(rate, `${root.dataset.fps} fps, ${root.dataset.scriptMs} ms`);
        frames = passed = spent = 0;
      }
      if (t >= last) { t = last; toggle(); }
    }
    const began = performance.now();
    draw();
    spent += performance.now() - began;
    if (playing) ask();
  };

  // The camera looks at `target` [m] from `distance` [m]. Angles are in rad.
  let yaw = 0, pitch = 0, distance = 1, target = [0, 0, 0], kept = { yaw, pitch, distance, target };
  /** Shows the whole flight, with its longer side across the picture; a flat flight is seen from higher up. */
  const home = () => {
    [yaw, pitch, target, distance] = [half[0] < half[1] ? -0.35 : -1.22,
      half[2] < 0.3 * Math.max(half[0], half[1]) ? 0.8 : 0.45, data.look_m, 0];
    const { right, up, back } = axes(), across = canvas.clientWidth / canvas.clientHeight || 1;
    // Corners of the box around the flight.
    for (let k = 0; k < 8; k++) {
      const [x, y, z] = [right, up, back].map(axis =>
        axis.reduce((sum, part, at) => sum + part * half[at] * (k >> at & 1 ? 1 : -1), 0));
      distance = Math.max(distance, 1.04 * (Math.max(Math.abs(x) / across, Math.abs(y)) / TANGENT + z));
    }
  };
  /** Axes of the camera, and its position. */
  const axes = () => {
    const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
    const back = [cp * cy, cp * sy, sp];
    const eye = back.map((x, k) => target[k] + x * distance);
    return { right: [-sy, cy, 0], up: [-sp * cy, -sp * sy, cp], back, eye };
  };
  const turn = (/** @type {number} */ by, /** @type {number} */ lift) => {
    yaw += by;
    pitch = clamp(pitch + lift, -1.55, 1.55);
    ask();
  };
  const zoom = (/** @type {number} */ by) => {
    distance = clamp(distance * by, Math.min(reach * 0.01, 4 * least_m), reach * 20);
    ask();
  };
  const pan = (/** @type {number} */ dx, /** @type {number} */ dy) => {
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
  canvas.onpointerdown = event => {
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
  canvas.onpointerup = event => fingers.delete(event.pointerId);
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
  /** @type {Object<string, (shift: boolean) => void>} */
  const keys = {
    " ": toggle, Home: () => go(first), End: () => go(last), c: () => jump("closest", 1), f: home,
    v: shift => jump("violation", shift ? -1 : 1), u: shift => jump("undecided", shift ? -1 : 1),
    ArrowLeft: shift => go(shift ? t - 1 : [...times].findLast(time => time < t) ?? first),
    ArrowRight: shift => go(shift ? t + 1 : times[upTo(times, t)] ?? last),
    a: () => turn(-0.1, 0), d: () => turn(0.1, 0), w: () => turn(0, 0.1), s: () => turn(0, -0.1),
    PageUp: () => zoom(0.8), PageDown: () => zoom(1.25),
    "+": () => faster(1), "=": () => faster(1), "-": () => faster(-1),
  };
  panel.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => {
    const on = /** @type {HTMLElement} */ (event.target);
    const key = event.key.length > 1 ? event.key : event.key.toLowerCase();
    if (event.ctrlKey || event.altKey || event.metaKey || on === speeds
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
   * Makes the texture of a unit.
   * @param {number} unit @param {number} format @param {number} across @param {number} high @param {number} kind
   * @param {ArrayBufferView} from
   */
  const texture = (unit, format, across, high, kind, from) => {
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texImage2D(gl.TEXTURE_2D, 0, format, across, high, 0, gl.RGBA, kind, from);
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
  const solid = program("SOLID", "FLAT");
  texture(0, gl.RGBA32F, wide, times.length, gl.FLOAT, path);
  const paint = new Uint8Array(count * 4).fill(255);
  texture(1, gl.RGBA8, count, 1, gl.UNSIGNED_BYTE, paint);
  const bodies = mesh([3], 1, 1, Float32Array.from(radius)), slots = mesh([0], 3, 1);
  const links = mesh([2], 3, 1), pairs = mesh([2], 3, 1);
  const ground = mesh([0, 1], 3, 1, new Float32Array(bytes(data.ground)));
  const things = data.things.map(({ solid, rims, ...rest }) => ({ ...rest,
    solid: mesh([0, 1], 3, 0, new Float32Array(bytes(solid))),
    rims: mesh([0, 1], 3, 1, new Float32Array(bytes(rims))) }));
  gl.bindVertexArray(null);

  // Drawing. The time lies between the instants `row` and `next`, at the share `part` of the interval. `painted` lists
  // the vehicles in red, `shape` is the number of the formation in the meshes.
  const dark = matchMedia("(prefers-color-scheme: dark)");
  let colours = LIGHT, painted = "", shape = -1, row = 0, next = 0, part = 0;
  /** Applies the colours of the reader's theme. */
  const themed = () => { [colours, painted] = [dark.matches ? DARK : LIGHT, "?"]; ask(); };
  /**
   * Fits a canvas to its size on the page. Returns device pixels per CSS pixel, 0 for a canvas without a size.
   * @param {HTMLCanvasElement} of
   */
  const fit = of => {
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
    return [0, 1, 2].map(axis => path[a + axis] + (path[b + axis] - path[a + axis]) * part)
      .concat(path[a + 3] && (part <= 0 || path[a + 3] === path[b + 3]) ? 1 : 0);
  };
  /** Position of an obstacle from the origin [m]. @param {number[][]} way */
  const thingAt = way => {
    const k = clamp(upTo(way.map(point => point[0]), t), 0, way.length - 1);
    const [a, b] = [way[Math.max(k - 1, 0)], way[k]];
    const share = b[0] > a[0] ? clamp((t - a[0]) / (b[0] - a[0]), 0, 1) : 1;
    return [1, 2, 3].map(axis => a[axis] + (b[axis] - a[axis]) * share - data.origin_m[axis - 1]);
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
  const draw = () => {
    const ratio = fit(canvas);
    if (!ratio || ended) return;
    const size = [canvas.width, canvas.height], { right, up, back, eye } = axes();
    const lens = [TANGENT * size[0] / size[1], TANGENT, distance * 0.02, distance + reach * 12];
    seek();
    // Violations of this time, and their vehicles.
    const [, alarm, verdict, named, thing] = latest(data.verdicts, t) ?? [0, false, "", [], null];
    const wrong = [...moments.filter(of => of.kind === "violation" && of.from_s <= t && t <= of.to_s),
      { who: named, thing }];
    const who = new Set(wrong.flatMap(of => of.who));
    if ([...who].join() !== painted) {
      painted = [...who].join();
      for (let k = 0; k < count; k++) {
        const colour = who.has(k) ? colours.alarm : colours.vehicles[count < 200 ? k % 6 : 0];
        paint.set([colour >> 16, colour >> 8 & 255, colour & 255], 4 * k);
      }
      gl.activeTexture(gl.TEXTURE1);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, count, 1, gl.RGBA, gl.UNSIGNED_BYTE, paint);
    }
    reform();
    gl.viewport(0, 0, size[0], size[1]);
    gl.clearColor(...(/** @type {[number, number, number, number]} */ (rgba(colours.paper))));
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
          else if (value.length === 3) gl.uniform3fv(to, value); else gl.uniform4fv(to, value);
        }
      };
      set({ right, up, back, eye, lens, size, path: 0, paint: 1, row, next, part, points: count, shell: [0, 0, 0],
        offset: [0, 0, 0], fixedAt: [0, 0, 0, 0], fixedPaint: [0, 0, 0, 0], ...values });
    };
    /** Draws copies of a quad. @param {Mesh | null} of @param {number} [copies] */
    const quads = (of, copies = of?.count ?? 0) => {
      gl.bindVertexArray(of?.vao ?? null);
      if (copies > 0) gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, copies);
    };
    const near = new Set(wrong.map(of => of.thing));
    const solids = (/** @type {boolean} */ opaque) => things.forEach((thing, k) => {
      const colour = near.has(k) ? colours.alarm : colours.thing, offset = thingAt(thing.path);
      if (thing.radius_m !== null && opaque) {
        use(ball, { fixedAt: [...offset, thing.radius_m], fixedPaint: rgba(colour) });
        quads(null, 1);
      } else if (thing.opacity === 1 === opaque) {
        use(solid, { offset, tint: rgba(colour, thing.opacity) });
        gl.bindVertexArray(thing.solid.vao);
        gl.drawArrays(gl.TRIANGLES, 0, thing.solid.count);
        use(line, { offset, kind: 0, width: 1.4 * ratio, tint: rgba(colour, Math.min(2 * thing.opacity, 1)) });
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
    use(line, { kind: 0, width: ratio, tint: rgba(colours.grid) });
    quads(ground);
    if (shows.trails) {
      let stride = 1;
      while (row / stride > clamp(Math.floor(TRAIL_PIECES / count), 2, 400)) stride *= 2;
      set({ kind: 2, width: (count < 50 ? 2 : 1.3) * ratio, stride, newest: row - row % stride, now: t - first,
        fading: Math.max(0.25 * (last - first), 1e-9) });
      quads(null, count * (Math.floor(row / stride) + 1));
    }
    const many = links.count;
    set({ kind: 1, width: clamp(2.2 - many / 200, 1, 2.2) * ratio, delta: data.tension ? data.delta_m : -1,
      tint: [0, 0, 0, 0], push: rgba(colours.push), pull: rgba(colours.pull),
      rest: rgba(colours.rest, clamp(36 / many, 0.08, 0.9)) });
    if (shows.links) quads(links);
    // Lines of the closest pair, as the page's data names it, and of all pairs in violation.
    const k = 2 * upTo(nearS, t) - 2, closest = [nearWho[k], nearWho[k + 1]].filter(vehicle => vehicle < count);
    for (const [two, colour, width] of /** @type {[number[][], number, number][]} */ ([
      [[closest], colours.ink, 2.6], [wrong.map(of => of.who), colours.alarm, 5]])) {
      set({ tint: rgba(colour), width: width * ratio });
      refill(pairs, Float32Array.from(two.filter(pair => pair.length === 2).flatMap(pair => [...pair, 0])));
      quads(pairs);
    }
    if (shows.slots && data.axes !== null) {
      // Axes that jump between two instants are not interpolated.
      const from = (row * wide + data.axes + 1) * 4, to = (next * wide + data.axes + 1) * 4;
      const jumps = [...path.subarray(from, from + 12)].some((x, at) =>
        Math.abs(x - path[to + at]) > 0.4 * data.axis_m);
      use(mark, { axis: data.axes, mark: 0, part: jumps ? 0 : part, length_m: data.axis_m, size_m: 1.45 * least_m,
        least: 4 * ratio, stroke: 0.8 * ratio, tint: [0, 0, 0, count < 200 ? 0.85 : 0.45] });
      quads(slots);
    }
    if (data.reference !== null) {
      use(mark, { axis: data.reference, mark: 1, least: 7 * ratio, stroke: 0.8 * ratio, tint: rgba(colours.ink) });
      quads(null, 1);
    }
    solids(false);
    // The order of shells of one colour does not matter. Those of vehicles in violation come last.
    if (data.shell_m) {
      use(ball, { shell: data.shell_m, fixedPaint: rgba(colours.shell, 0.6) });
      if (shows.shells) quads(bodies);
      for (const at of [...who].map(place).filter(at => at[3])) {
        set({ fixedAt: at, fixedPaint: rgba(colours.alarm, 0.85) });
        quads(null, 1);
      }
    }
    gl.depthMask(true);

    // Labels, on the second canvas.
    const pen = names.getContext("2d");
    if (pen && fit(names)) {
      pen.clearRect(0, 0, names.width, names.height);
      pen.font = `${12 * ratio}px system-ui, sans-serif`;
      [pen.textAlign, pen.lineJoin, pen.lineWidth] = ["center", "round", 3 * ratio];
      pen.strokeStyle = css(colours.paper);
      for (const vehicle of !shows.names ? [] : count <= NAMED ? radius.keys() : new Set([...closest, ...who])) {
        const [x, y, z, there] = place(vehicle);
        const [across, above, away] = [right, up, back].map(axis =>
          (x - eye[0]) * axis[0] + (y - eye[1]) * axis[1] + (z - eye[2]) * axis[2]);
        if (!there || -away < lens[2]) continue;
        const px = (1 - across / away / lens[0]) * size[0] / 2, py = (1 + above / away / lens[1]) * size[1] / 2
          - Math.max(radius[vehicle] / -away / lens[1] * size[1] / 2, 2 * ratio) - 4 * ratio;
        pen.fillStyle = css(who.has(vehicle) ? colours.alarm : colours.ink);
        pen.strokeText(data.vehicles[vehicle], px, py);
        pen.fillText(data.vehicles[vehicle], px, py);
      }
    }
    const time = t.toFixed(data.decimals);
    write(state,
      [verdict, latest(data.nearest, t)?.[1], `squares of ${data.square_m} m`].filter(words => words).join(" · "));
    state.classList.toggle("replay-alarm", alarm);
    write(clock, time + " s");
    scrub.value = t;
    scrub.setAttribute("aria-valuetext", `${time} of ${last.toFixed(data.decimals)} seconds`);
    head.style.left = `${100 * (t - first) / (last - first || 1)}%`;
  };
  canvas.addEventListener("webglcontextlost", () => {
    if (!ended) lose(root, "The graphics were lost. Start the replay again.");
  });
  dark.addEventListener("change", themed);
  const sized = new ResizeObserver(draw);
  sized.observe(stage);
  home();
  themed();
  return {
    root, draw,
    /**
     * Draws a view at once, for tests: angles in rad, lengths in m, the time in s. Returns the camera.
     * @param {{yaw: number, pitch: number, distance: number, target: number[], t: number}} view
     */
    look(view) {
      ({ yaw, pitch, distance, target } = view);
      t = view.t;
      draw();
      return { ...axes(), tangent: TANGENT, place };
    },
    end() {
      ended = true;
      cancelAnimationFrame(queued);
      sized.disconnect();
      dark.removeEventListener("change", themed);
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
    "aria-label": "Replay this flight: " + (root.dataset.label ?? "") }, "Replay this flight");
  start.onclick = () => { open(root); root.querySelector("canvas")?.focus(); };
  root.prepend(start);
};
for (const root of /** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll(".replay")))
  if (root.dataset.start) offer(root); else open(root);
})();
