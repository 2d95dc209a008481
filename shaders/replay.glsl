// Shaders of replays. A line `@ NAME BASE` begins the shader NAME, which follows the source of BASE.
// NAME_PIXEL is the fragment shader of NAME. Pages hold this file without the lines that begin with two slashes.
//
// Every vertex shader draws a quad of four vertices, many times; only SOLID draws triangles.
// Lengths are in m. `lens` holds the tangents of half the angles of view, and the nearest and farthest depth.
// `parallel` is 0 in perspective. A parallel view has the size of a perspective one at this depth.
@ COMMON
#version 300 es
precision highp float; precision highp int; precision highp sampler2D;
uniform vec3 right, up, back, eye, light; uniform vec4 lens; uniform vec2 size; uniform float parallel;
// Axes of the camera (view space): right, up, towards the camera.
vec3 turned(vec3 v) { return vec3(dot(right, v), dot(up, v), dot(back, v)); }
vec3 view(vec3 p) { return turned(p - eye); }
// Depth that scales a position in view space.
float depth(vec3 p) { return parallel > 0. ? parallel : -p.z; }
// Clip coordinates of a position in view space.
vec4 toClip(vec3 p) {
  float n = lens.z, f = lens.w, w = depth(p);
  return vec4(p.xy / lens.xy, (parallel > 0. ? w * (-2. * p.z - f - n) : -p.z * (f + n) - 2. * f * n) / (f - n), w);
}
@ VERTEX COMMON
// `path` has a row for each instant and a column for each point (assets/replay.js); `part` is the share of the interval
// between the instants `row` and `next`. `paint` has the colour of each vehicle.
// `value` has a number for each vehicle and instant, which colours it if `spanned` is a range; `turn` has attitudes.
uniform sampler2D path, paint, value, turn; uniform int row, next; uniform float part; uniform int points;
uniform vec2 spanned; uniform vec3 ramp[4];
vec4 point(int k, int instant) { return texelFetch(path, ivec2(k, instant), 0); }
// Position of a point at the time of the picture, and 0 where it is absent.
vec4 place(int k) {
  vec4 a = point(k, row), b = point(k, next);
  return vec4(mix(a.xyz, b.xyz, part), part <= 0. || a.w == b.w ? a.w : 0.);
}
// Colour of a vehicle at an instant: its own, or that of its number.
vec3 hue(int k, int instant) {
  if (spanned.y <= spanned.x) return texelFetch(paint, ivec2(k, 1), 0).rgb;
  float s = 3. * clamp((texelFetch(value, ivec2(k, instant), 0).r - spanned.x) / (spanned.y - spanned.x), 0., 1.);
  int n = min(int(s), 2);
  return mix(ramp[n], ramp[n + 1], s - float(n));
}
// Colour of a vehicle at the time of the picture; that of an alarm in a violation.
vec3 hueNow(int k) {
  vec4 own = texelFetch(paint, ivec2(k, 0), 0);
  return own.a < .5 ? own.rgb : mix(hue(k, row), hue(k, next), part);
}
// Rotors of a quadrotor and its nose, from the centre of the body. Arms shorter than `armLeast` pixels are enlarged.
uniform vec3 arms[5]; uniform float arm, armLeast;
vec3 rotated(int k, vec3 v) {
  vec4 a = texelFetch(turn, ivec2(k, row), 0), b = texelFetch(turn, ivec2(k, next), 0);
  vec4 q = normalize(mix(a, dot(a, b) < 0. ? -b : b, part));
  return v + 2. * cross(q.xyz, cross(q.xyz, v) + q.w * v);
}
float enlarged(vec3 at) { return max(1., armLeast * 2. * lens.y / size.y * max(depth(view(at)), 0.) / arm); }
// Points from `axis` on: the middle of the slots and the ends of their three axes of `length_m`.
uniform int axis; uniform float length_m;
// Position of a slot relative to their middle.
vec4 slot(vec3 at) {
  vec4 c = place(axis);
  return vec4(c.xyz + ((place(axis + 1).xyz - c.xyz) * at.x + (place(axis + 2).xyz - c.xyz) * at.y
    + (place(axis + 3).xyz - c.xyz) * at.z) / length_m, c.w);
}
// Height of the ground.
uniform float level;
// Outside of the picture.
const vec4 NOWHERE = vec4(2, 2, 2, 1);
@ BALL VERTEX
// A ball or, for `shell` > 0, an ellipsoid with these half axes: of each vehicle, or one at `fixedAt` with its radius.
// The quad covers the outline of the ball; BALL_PIXEL finds the point of the surface for each pixel.
in float radius; uniform vec4 fixedAt, fixedPaint; uniform vec3 shell; uniform float least;
flat out vec3 centre, axes; flat out vec4 colour;
void main() {
  vec4 at = fixedAt.w > 0. ? vec4(fixedAt.xyz, 1) : place(gl_InstanceID);
  colour = fixedPaint.w > 0. ? fixedPaint : vec4(hueNow(gl_InstanceID), 1);
  centre = at.xyz;
  vec3 c = view(centre);
  float pixel = 2. * lens.y / size.y, away = length(c);
  axes = shell.x > 0. ? shell : vec3(max(fixedAt.w > 0. ? fixedAt.w : radius, least * pixel * max(depth(c), 0.)));
  float r = max(axes.x, max(axes.y, axes.z));
  vec2 side = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2. - 1.;
  // Absent, or behind the camera; the camera within the ball or beside it: the whole picture.
  if (at.w < .5 || c.z >= r) gl_Position = NOWHERE;
  else if (parallel > 0.) {
    gl_Position = toClip(c + vec3(side, 0) * (r + 2. * pixel * parallel));
    gl_Position.z = 0.;
  }
  else if (away < 1.001 * r || -c.z < r) gl_Position = vec4(side, 0, 1);
  else {
    // Circle in which the cone of sight around the ball cuts the plane through its centre, and two pixels more.
    vec3 axis = c / away, across = normalize(cross(vec3(0, 1, 0), axis)), along = cross(axis, across);
    float sine = r / away, reach = r / sqrt(1. - sine * sine) + 2. * pixel * away;
    gl_Position = toClip(c + (across * side.x + along * side.y) * reach);
    gl_Position.z = 0.;
  }
}
@ BALL_PIXEL COMMON
flat in vec3 centre, axes; flat in vec4 colour; uniform vec3 shell; out vec4 pixel;
void main() {
  // Ray through the pixel, in lengths in which the ellipsoid is a unit ball.
  vec2 plane = (gl_FragCoord.xy / size * 2. - 1.) * lens.xy;
  vec3 across = right * plane.x + up * plane.y, from = eye + across * parallel;
  vec3 ray = parallel > 0. ? -back : across - back, to = (from - centre) / axes, d = ray / axes;
  float dd = dot(d, d), middle = -dot(to, d) / dd;
  vec3 foot = to + d * middle;
  float chord = 1. - dot(foot, foot);
  float edge = clamp(chord / max(length(vec2(dFdx(chord), dFdy(chord))), 1e-9) + .5, 0., 1.);
  float halfway = sqrt(max(chord, 0.) / dd);
  float along = middle - halfway < 0. ? middle + halfway : middle - halfway;
  if (edge <= 0. || along < 0.) discard;
  vec3 hit = from + ray * along, n = normalize((hit - centre) / (axes * axes));
  n = turned(n);
  vec3 towards = parallel > 0. ? vec3(0, 0, 1) : normalize(-view(hit));
  vec4 clip = toClip(view(hit));
  gl_FragDepth = clamp(clip.z / clip.w * .5 + .5, 0., 1.);
  if (shell.x > 0.) {
    float rim = 1. - abs(dot(n, towards));
    pixel = vec4(colour.rgb, colour.a * edge * (.1 + .9 * rim * rim * rim));
  } else {
    float lit = .5 + .5 * max(dot(n, light), 0.);
    float gloss = .16 * pow(max(dot(n, normalize(light + towards)), 0.), 48.);
    pixel = vec4(colour.rgb * lit + gloss, edge);
  }
}
@ LINE VERTEX
// A straight line of a width in pixels. `kind` 0 joins two positions, 1 a pair of vehicles, 2 is a piece of a trail,
// 3 a piece of a trail between two times, 4 an arm of a quadrotor, 5 a line from a vehicle to the ground, 6 to its slot.
in vec3 from, to; in vec3 pair; uniform int kind, stride, newest;
uniform float width, delta, fading, now, tail; uniform vec3 offset;
uniform vec4 tint, push, rest, pull; out vec4 colour;
float sinhOf(float x) { return .5 * (exp(x) - exp(-x)); }
void main() {
  vec4 a = vec4(from + offset, 1), b = vec4(to + offset, 1);
  colour = tint;
  if (kind == 1) {
    a = place(int(pair.x)); b = place(int(pair.y));
    // A link without a colour of its own shows its tension between -1 and 1: `d` is its length in the formation.
    if (tint.a <= 0.) {
      float l = distance(a.xyz, b.xyz), d = pair.z, pulled = 0.;
      if (d > 0.) pulled =
        delta < 0. ? (l - d) / d : l <= delta ? -1. :
        1. - 1. / pow(sinhOf(min((l - delta) * .881373587 / (d - delta), 9.)), 2.);
      pulled = clamp(pulled, -1., 1.);
      colour = mix(rest, pulled < 0. ? push : pull, abs(pulled));
      colour.a = rest.a * (.45 + .55 * abs(pulled));
    }
  } else if (kind == 2) {
    // Pieces go back in time from the newest instant of the stride; the first one ends at the vehicle.
    int k = gl_InstanceID % points, piece = gl_InstanceID / points, old = newest - piece * stride;
    a = point(k, max(old, 0));
    b = piece == 0 ? place(k) : point(k, max(old + stride, 0));
    float age = now - point(textureSize(path, 0).x - 1, max(old, 0)).x;
    colour = vec4(hue(k, max(old, 0)), .16 + .74 * max(0., 1. - age / fading));
    if (old < 0 || a.w != b.w || age > tail) a.w = 0.;
  } else if (kind == 3) {
    if (pair.x > now || now - pair.y > tail) a.w = 0.;
    b.xyz = mix(a.xyz, b.xyz, clamp((now - pair.x) / max(pair.y - pair.x, 1e-9), 0., 1.));
  } else if (kind == 4) {
    int k = gl_InstanceID / 5, j = gl_InstanceID % 5;
    a = place(k);
    b = vec4(a.xyz + rotated(k, arms[j]) * enlarged(a.xyz), a.w);
    if (j < 4) colour = vec4(hueNow(k), 1);
  } else if (kind >= 5) {
    a = place(gl_InstanceID);
    b = kind == 5 ? vec4(a.xy, level, a.w) : slot(from);
    colour = kind == 5 ? tint : vec4(hueNow(gl_InstanceID), .4);
  }
  vec3 p = view(a.xyz), q = view(b.xyz);
  float n = lens.z;
  if (a.w * b.w < .5 || (-p.z < n && -q.z < n)) { gl_Position = NOWHERE; return; }
  // The part ahead of the camera.
  if (-p.z < n) p = mix(p, q, (n + p.z) / (p.z - q.z));
  if (-q.z < n) q = mix(q, p, (n + q.z) / (q.z - p.z));
  vec4 u = toClip(p), v = toClip(q);
  vec2 run = (v.xy / v.w - u.xy / u.w) * size;
  vec2 across = dot(run, run) > 0. ? normalize(vec2(-run.y, run.x)) : vec2(0, 1);
  gl_Position = (gl_VertexID & 1) == 1 ? v : u;
  gl_Position.xy += across * (float(gl_VertexID >> 1) - .5) * 2. * width / size * gl_Position.w;
}
@ ROTOR VERTEX
// Disc of a rotor across the axis of its body.
uniform float rotor; out vec4 colour; out vec2 at;
void main() {
  int k = gl_InstanceID / 4;
  vec4 c = place(k);
  float times = enlarged(c.xyz);
  at = (vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2. - 1.) * 1.15;
  colour = vec4(hueNow(k), 1);
  vec3 p = view(c.xyz + (rotated(k, arms[gl_InstanceID % 4]) + rotated(k, vec3(at * rotor, 0))) * times);
  gl_Position = c.w < .5 || -p.z < lens.z ? NOWHERE : toClip(p);
}
@ ROTOR_PIXEL COMMON
in vec4 colour; in vec2 at; out vec4 pixel;
void main() {
  float d = length(at), soft = fwidth(d), ring = 1. - smoothstep(.06, .06 + 1.5 * soft, abs(d - .94));
  float a = max(.85 * ring, d < .94 ? .3 : 0.);
  if (a <= .02) discard;
  pixel = vec4(colour.rgb, a);
}
@ FLAT_PIXEL COMMON
in vec4 colour; out vec4 pixel; void main() { pixel = colour; }
@ MARK VERTEX
// A ring around a slot (`mark` 0) or the diamond of the reference (1), in the plane of the picture, the mark on the
// ground below a vehicle (2), the glow of a light (3) or its white centre (4), `lift` ahead of the vehicle.
in vec3 from; uniform int mark; uniform float size_m, least, lift; uniform vec4 tint;
out vec4 colour; out vec2 at; flat out float thin;
void main() {
  vec4 c = mark == 0 ? slot(from) : place(mark == 1 ? axis : gl_InstanceID);
  colour = tint;
  if (mark == 0) colour = vec4(texelFetch(paint, ivec2(gl_InstanceID, 1), 0).rgb, tint.a);
  if (mark == 2) c.z = level;
  if (mark == 2 || mark == 3) colour = vec4(hueNow(gl_InstanceID), tint.a);
  vec3 s = view(c.xyz);
  if (mark > 2) s.z += lift;
  float pixel = 2. * lens.y / size.y * depth(s), r = mark == 1 ? least * pixel : max(size_m, least * pixel);
  at = (vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2. - 1.) * (1. + 2. * pixel / r);
  thin = r / pixel;
  gl_Position = c.w < .5 || -s.z < lens.z ? NOWHERE : toClip(mark == 2 ? view(c.xyz + vec3(at * r, 0)) : s + vec3(at * r, 0));
}
@ MARK_PIXEL COMMON
in vec4 colour; in vec2 at; flat in float thin; uniform int mark; uniform float stroke; out vec4 pixel;
void main() {
  float away = length(at);
  if (mark > 1) {
    pixel = vec4(colour.rgb, colour.a * (mark == 2 ? clamp((1. - away) * thin + .5, 0., 1.) : pow(max(1. - away, 0.), 2.)));
    return;
  }
  float d = abs((mark == 0 ? away : abs(at.x) + abs(at.y)) - 1.) * thin;
  float a = clamp(stroke - d + .5, 0., 1.);
  if (a <= 0.) discard;
  pixel = vec4(colour.rgb, colour.a * a);
}
@ SOLID VERTEX
// Triangles: positions and normals; a normal of 0 is not shaded.
in vec3 from, to; uniform vec3 offset; uniform vec4 tint; out vec4 colour;
void main() {
  gl_Position = toClip(view(from + offset));
  vec3 n = turned(to);
  colour = vec4(tint.rgb * (dot(to, to) > 0. ? .62 + .38 * max(dot(n, light), 0.) : 1.), tint.a);
}
