// How a replay is drawn: pieces of shaders, each after its name and the pieces that it begins with.
@ COMMON
#version 300 es
precision highp float; precision highp int; precision highp sampler2D;
uniform vec3 right, up, back, eye; uniform vec4 lens; uniform vec2 size;
vec3 seen(vec3 p) { vec3 d = p - eye; return vec3(dot(right, d), dot(up, d), dot(back, d)); }
vec4 clipped(vec3 p) { float n = lens.z, f = lens.w; return vec4(p.xy / lens.xy, (-p.z * (f + n) - 2. * f * n) / (f - n), -p.z); }
@ VERTEX COMMON
uniform sampler2D path, paint; uniform int row, next; uniform float part; uniform int points;
vec4 place(int k) {
  vec4 a = texelFetch(path, ivec2(k, row), 0), b = texelFetch(path, ivec2(k, next), 0);
  return vec4(mix(a.xyz, b.xyz, part), part <= 0. || a.w == b.w ? a.w : 0.);
}
const vec4 NOWHERE = vec4(2, 2, 2, 1);
@ BALL VERTEX
in float radius; uniform vec4 fixedAt, fixedPaint; uniform vec3 shell; uniform float least;
flat out vec3 centre, axes; flat out vec4 colour;
void main() {
  vec4 at = fixedAt.w > 0. ? vec4(fixedAt.xyz, 1) : place(gl_InstanceID);
  colour = fixedPaint.w > 0. ? fixedPaint : texelFetch(paint, ivec2(gl_InstanceID, 0), 0);
  centre = at.xyz;
  vec3 c = seen(centre);
  float pixel = 2. * lens.y / size.y, away = length(c);
  axes = shell.x > 0. ? shell : vec3(max(fixedAt.w > 0. ? fixedAt.w : radius, least * pixel * max(-c.z, 0.)));
  float r = max(axes.x, max(axes.y, axes.z));
  vec2 side = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2. - 1.;
  if (at.w < .5 || c.z >= r) gl_Position = NOWHERE;
  else if (away < 1.001 * r || -c.z < r) gl_Position = vec4(side, 0, 1);
  else {
    vec3 axis = c / away, across = normalize(cross(vec3(0, 1, 0), axis)), along = cross(axis, across);
    float sine = r / away, reach = r / sqrt(1. - sine * sine) + 2. * pixel * away;
    gl_Position = clipped(c + (across * side.x + along * side.y) * reach);
    gl_Position.z = 0.;
  }
}
@ BALL_PIXEL COMMON
flat in vec3 centre, axes; flat in vec4 colour; uniform vec3 shell; out vec4 pixel;
void main() {
  vec2 flatly = (gl_FragCoord.xy / size * 2. - 1.) * lens.xy;
  vec3 ray = right * flatly.x + up * flatly.y - back, to = (eye - centre) / axes, d = ray / axes;
  float dd = dot(d, d), middle = -dot(to, d) / dd;
  vec3 foot = to + d * middle;
  float chord = 1. - dot(foot, foot), edge = clamp(chord / max(length(vec2(dFdx(chord), dFdy(chord))), 1e-9) + .5, 0., 1.);
  float halfway = sqrt(max(chord, 0.) / dd), along = middle - halfway < 0. ? middle + halfway : middle - halfway;
  if (edge <= 0. || along < 0.) discard;
  vec3 hit = eye + ray * along, n = normalize((hit - centre) / (axes * axes));
  n = vec3(dot(right, n), dot(up, n), dot(back, n));
  vec4 clip = clipped(seen(hit));
  gl_FragDepth = clamp(clip.z / clip.w * .5 + .5, 0., 1.);
  if (shell.x > 0.) {
    float rim = 1. - abs(dot(n, normalize(-seen(hit))));
    pixel = vec4(colour.rgb, colour.a * edge * (.1 + .9 * rim * rim * rim));
  } else {
    const vec3 light = vec3(-.408, .577, .707);
    float lit = .5 + .5 * max(dot(n, light), 0.), gloss = .16 * pow(max(dot(n, normalize(light + normalize(-seen(hit)))), 0.), 48.);
    pixel = vec4(colour.rgb * lit + gloss, edge);
  }
}
@ LINE VERTEX
in vec3 from, to; in vec3 pair; uniform int kind, stride, newest; uniform float width, delta, fading, now; uniform vec3 offset;
uniform vec4 tint, push, rest, pull; out vec4 colour;
float sinhOf(float x) { return .5 * (exp(x) - exp(-x)); }
void main() {
  vec4 a = vec4(from + offset, 1), b = vec4(to + offset, 1);
  colour = tint;
  if (kind == 1) {
    a = place(int(pair.x)); b = place(int(pair.y));
    if (tint.a <= 0.) {
      float l = distance(a.xyz, b.xyz), d = pair.z, pulled = 0.;
      if (d > 0.) pulled = delta < 0. ? (l - d) / d : l <= delta ? -1. : 1. - 1. / pow(sinhOf(min((l - delta) * .881373587 / (d - delta), 9.)), 2.);
      pulled = clamp(pulled, -1., 1.);
      colour = mix(rest, pulled < 0. ? push : pull, abs(pulled));
      colour.a = rest.a * (.45 + .55 * abs(pulled));
    }
  } else if (kind == 2) {
    int k = gl_InstanceID % points, piece = gl_InstanceID / points, old = newest - piece * stride;
    a = texelFetch(path, ivec2(k, max(old, 0)), 0);
    b = piece == 0 ? place(k) : texelFetch(path, ivec2(k, max(old + stride, 0)), 0);
    float age = now - texelFetch(path, ivec2(textureSize(path, 0).x - 1, max(old, 0)), 0).x;
    colour = vec4(texelFetch(paint, ivec2(k, 0), 0).rgb, .16 + .74 * max(0., 1. - age / fading));
    if (old < 0 || a.w != b.w) a.w = 0.;
  }
  vec3 p = seen(a.xyz), q = seen(b.xyz);
  float n = lens.z;
  if (a.w * b.w < .5 || (-p.z < n && -q.z < n)) { gl_Position = NOWHERE; return; }
  if (-p.z < n) p = mix(p, q, (n + p.z) / (p.z - q.z));
  if (-q.z < n) q = mix(q, p, (n + q.z) / (q.z - p.z));
  vec4 u = clipped(p), v = clipped(q);
  vec2 run = (v.xy / v.w - u.xy / u.w) * size, across = dot(run, run) > 0. ? normalize(vec2(-run.y, run.x)) : vec2(0, 1);
  gl_Position = (gl_VertexID & 1) == 1 ? v : u;
  gl_Position.xy += across * (float(gl_VertexID >> 1) - .5) * 2. * width / size * gl_Position.w;
}
@ FLAT_PIXEL COMMON
in vec4 colour; out vec4 pixel; void main() { pixel = colour; }
@ MARK VERTEX
in vec3 from; uniform int axis, mark; uniform float length_m, size_m, least; uniform vec4 tint; out vec4 colour; out vec2 at; flat out float thin;
void main() {
  vec4 c = place(axis);
  vec3 p = c.xyz;
  colour = tint;
  if (mark == 0) {
    p += ((place(axis + 1).xyz - c.xyz) * from.x + (place(axis + 2).xyz - c.xyz) * from.y + (place(axis + 3).xyz - c.xyz) * from.z) / length_m;
    colour = vec4(texelFetch(paint, ivec2(gl_InstanceID, 0), 0).rgb, tint.a);
  }
  vec3 s = seen(p);
  float pixel = 2. * lens.y / size.y * -s.z, r = mark == 0 ? max(size_m, least * pixel) : least * pixel;
  at = (vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2. - 1.) * (1. + 2. * pixel / r);
  thin = r / pixel;
  gl_Position = c.w < .5 || -s.z < lens.z ? NOWHERE : clipped(s + vec3(at * r, 0));
}
@ MARK_PIXEL COMMON
in vec4 colour; in vec2 at; flat in float thin; uniform int mark; uniform float stroke; out vec4 pixel;
void main() {
  float d = abs((mark == 0 ? length(at) : abs(at.x) + abs(at.y)) - 1.) * thin;
  float a = clamp(stroke - d + .5, 0., 1.);
  if (a <= 0.) discard;
  pixel = vec4(colour.rgb, colour.a * a);
}
@ SOLID VERTEX
in vec3 from, to; uniform vec3 offset; uniform vec4 tint; out vec4 colour;
void main() {
  gl_Position = clipped(seen(from + offset));
  vec3 n = vec3(dot(right, to), dot(up, to), dot(back, to));
  colour = vec4(tint.rgb * (dot(to, to) > 0. ? .62 + .38 * max(dot(n, vec3(-.408, .577, .707)), 0.) : 1.), tint.a);
}
