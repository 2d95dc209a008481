// Shaders of the scene: balls, faces, shells, lines and discs.
//
// View space has the camera's axes: right, up, towards the camera [m]. `gpu/pipelines.rs` of crates/render puts the
// constants of the light before this file: LIGHT, AMBIENT, GLOSS, SHININESS.

struct Camera {
    right: vec4<f32>,
    up: vec4<f32>,
    back: vec4<f32>,
    eye: vec4<f32>,
    // Half of width and height (tangents in perspective, metres in parallel projection), 1 in perspective, height of
    // shells over their width.
    lens: vec4<f32>,
    // Nearest and farthest depth [m], width and height [px].
    range: vec4<f32>,
}

@group(0) @binding(0) var<uniform> camera: Camera;

fn to_view(point: vec3<f32>) -> vec3<f32> {
    let from_eye = point - camera.eye.xyz;
    return vec3(dot(camera.right.xyz, from_eye), dot(camera.up.xyz, from_eye), dot(camera.back.xyz, from_eye));
}

fn is_perspective() -> bool {
    return camera.lens.z > 0.5;
}

// Clip coordinates of a position in view space. Depth is 1 at the nearest and 0 at the farthest plane: reversed depth
// keeps the precision of floating point over the whole range.
fn to_clip(at: vec3<f32>) -> vec4<f32> {
    let near = camera.range.x;
    let far = camera.range.y;
    let flat = at.xy / camera.lens.xy;
    let depth = (far + at.z) / (far - near);
    if is_perspective() {
        return vec4(flat, near * depth, -at.z);
    }
    return vec4(flat, depth, 1.0);
}

// Converts sRGB to linear light (IEC 61966-2-1).
fn to_linear(srgb: vec4<f32>) -> vec4<f32> {
    let low = srgb.rgb / 12.92;
    let high = pow((srgb.rgb + 0.055) / 1.055, vec3(2.4));
    return vec4(select(high, low, srgb.rgb <= vec3(0.04045)), srgb.a);
}

// Balls: quads on which each pixel computes its point of the sphere.

struct Ball {
    @location(0) centre: vec3<f32>,
    @location(1) radius: f32,
    @location(2) colour: vec4<f32>,
}

struct BallCorner {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) centre: vec3<f32>,
    @location(1) @interpolate(flat) radius: f32,
    @location(2) @interpolate(flat) colour: vec4<f32>,
}

struct Shade {
    @location(0) colour: vec4<f32>,
    @builtin(frag_depth) depth: f32,
    @builtin(sample_mask) samples: u32,
}

// Whether a ball is outside of one of the four side planes of the view frustum.
fn is_aside(centre: vec3<f32>, radius: f32) -> bool {
    let outside = abs(centre.xy) + camera.lens.xy * centre.z;
    return any(outside > radius * sqrt(1.0 + camera.lens.xy * camera.lens.xy));
}

@vertex
fn ball_corner(@builtin(vertex_index) index: u32, ball: Ball) -> BallCorner {
    let position = corner_around(index, ball, ball.radius);
    return BallCorner(position, to_view(ball.centre), ball.radius, to_linear(ball.colour));
}

// An upright ellipsoid, on the quad of the ball around it.
@vertex
fn shell_corner(@builtin(vertex_index) index: u32, ball: Ball) -> BallCorner {
    let around = ball.radius * max(1.0, camera.lens.w);
    return BallCorner(corner_around(index, ball, around), to_view(ball.centre), ball.radius, to_linear(ball.colour));
}

fn corner_around(index: u32, ball: Ball, radius: f32) -> vec4<f32> {
    let side = vec2(f32(index & 1u), f32(index >> 1u)) * 2.0 - 1.0;
    let centre = to_view(ball.centre);
    let distance = length(centre);
    var position: vec4<f32>;
    if is_perspective() && (centre.z >= radius || is_aside(centre, 1.001 * radius + 1e-5 * distance)) {
        // Behind the camera or outside the frustum: outside the picture.
        position = vec4(2.0, 2.0, 2.0, 1.0);
    } else if is_perspective() && (distance < 1.001 * radius || -centre.z < radius) {
        // The camera is within the ball or beside it: the whole picture.
        position = vec4(side, 0.5, 1.0);
    } else if is_perspective() {
        // Circle in which the cone of sight around the ball cuts the plane through its centre, and a pixel more.
        let pixel = 2.0 * camera.lens.y * distance / camera.range.w;
        let axis = centre / distance;
        let across = normalize(cross(vec3(0.0, 1.0, 0.0), axis));
        let along = cross(axis, across);
        let sine = radius / distance;
        let reach = radius / sqrt(1.0 - sine * sine) + pixel;
        position = to_clip(centre + (across * side.x + along * side.y) * reach);
    } else {
        let pixel = 2.0 * camera.lens.y / camera.range.w;
        position = to_clip(centre + vec3(side * (radius + pixel), 0.0));
    }
    // Each pixel computes the depth of the sphere.
    position.z = 0.5 * position.w;
    return position;
}

struct Ray {
    origin: vec3<f32>,
    direction: vec3<f32>,
}

fn ray_at(pixel: vec2<f32>) -> Ray {
    let flat = (pixel / camera.range.zw * vec2(2.0, -2.0) + vec2(-1.0, 1.0)) * camera.lens.xy;
    if is_perspective() {
        return Ray(vec3(0.0), vec3(flat, -1.0));
    }
    return Ray(vec3(flat, 0.0), vec3(0.0, 0.0, -1.0));
}

// Scales a vector of view space along the vertical: upright ellipsoids with this height over width become balls.
fn to_sphere(v: vec3<f32>, ratio: f32) -> vec3<f32> {
    let up = vec3(camera.right.z, camera.up.z, camera.back.z);
    return v + up * (dot(v, up) * (1.0 / ratio - 1.0));
}

// Squared half of the chord that a ball cuts from a ray, negative for a miss. The difference of squared distances would
// lose small balls far away, so the vector from the centre to the ray comes first.
fn chord(ray: Ray, centre: vec3<f32>, radius: f32, ratio: f32) -> f32 {
    let to_origin = to_sphere(ray.origin - centre, ratio);
    let direction = to_sphere(ray.direction, ratio);
    let foot = to_origin - direction * (dot(to_origin, direction) / dot(direction, direction));
    return radius * radius - dot(foot, foot);
}

struct Hit {
    at: vec3<f32>,
    normal: vec3<f32>,
    view: vec3<f32>,
    depth: f32,
    samples: u32,
    inside: bool,
}

fn hit(corner: BallCorner, ratio: f32) -> Hit {
    // Positions of the four samples of a pixel.
    var offsets = array(vec2(0.375, 0.125), vec2(0.875, 0.375), vec2(0.125, 0.625), vec2(0.625, 0.875));
    let pixel = floor(corner.position.xy);
    var samples = 0u;
    for (var k = 0u; k < 4u; k++) {
        if chord(ray_at(pixel + offsets[k]), corner.centre, corner.radius, ratio) >= 0.0 {
            samples |= 1u << k;
        }
    }
    let ray = ray_at(pixel + 0.5);
    let direction = to_sphere(ray.direction, ratio);
    let squared = dot(direction, direction);
    let middle = -dot(to_sphere(ray.origin - corner.centre, ratio), direction) / squared;
    let half = sqrt(max(chord(ray, corner.centre, corner.radius, ratio), 0.0) / squared);
    var along = middle - half;
    let inside = along < 0.0;
    if inside {
        along = middle + half;
    }
    if along < 0.0 {
        samples = 0u;
    }
    let at = ray.origin + ray.direction * along;
    let clip = to_clip(at);
    let normal = normalize(to_sphere(to_sphere(at - corner.centre, ratio), ratio));
    return Hit(at, normal, -normalize(ray.direction), clamp(clip.z / clip.w, 0.0, 1.0), samples, inside);
}

@fragment
fn solid(corner: BallCorner) -> Shade {
    let hit = hit(corner, 1.0);
    if hit.samples == 0u {
        discard;
    }
    let lit = AMBIENT + (1.0 - AMBIENT) * max(dot(hit.normal, LIGHT), 0.0);
    let gloss = GLOSS * pow(max(dot(hit.normal, normalize(LIGHT + hit.view)), 0.0), SHININESS);
    return Shade(vec4(corner.colour.rgb * lit + gloss, 1.0), hit.depth, hit.samples);
}

@fragment
fn shell(corner: BallCorner) -> Shade {
    let hit = hit(corner, camera.lens.w);
    if hit.samples == 0u {
        discard;
    }
    let rim = 1.0 - abs(dot(hit.normal, hit.view));
    let opacity = corner.colour.a * (0.10 + 0.90 * rim * rim * rim);
    return Shade(vec4(corner.colour.rgb, opacity), hit.depth, hit.samples);
}

// Straight lines with a width in pixels.

struct Line {
    @location(0) first: vec3<f32>,
    @location(1) second: vec3<f32>,
    @location(2) first_colour: vec4<f32>,
    @location(3) second_colour: vec4<f32>,
    @location(4) width: f32,
}

struct LineCorner {
    @builtin(position) position: vec4<f32>,
    @location(0) colour: vec4<f32>,
}

// End of the part of a line that is ahead of the camera.
fn ahead(point: vec3<f32>, other: vec3<f32>) -> vec3<f32> {
    let near = camera.range.x;
    if !is_perspective() || -point.z >= near || -other.z <= near {
        return point;
    }
    return mix(point, other, (near + point.z) / (point.z - other.z));
}

@vertex
fn line_corner(@builtin(vertex_index) index: u32, line: Line) -> LineCorner {
    let first = to_view(line.first);
    let second = to_view(line.second);
    let ends = array(to_clip(ahead(first, second)), to_clip(ahead(second, first)));
    let half_size = camera.range.zw / 2.0;
    let run = (ends[1].xy / ends[1].w - ends[0].xy / ends[0].w) * half_size;
    var across = vec2(0.0, 1.0);
    if dot(run, run) > 0.0 {
        across = normalize(vec2(-run.y, run.x));
    }
    let at_end = (index & 1u) == 1u;
    let side = select(-0.5, 0.5, (index >> 1u) == 1u);
    var position = ends[0];
    var colour = line.first_colour;
    if at_end {
        position = ends[1];
        colour = line.second_colour;
    }
    position += vec4(across * side * line.width / half_size * position.w, 0.0, 0.0);
    return LineCorner(position, to_linear(colour));
}

@fragment
fn stroke(corner: LineCorner) -> @location(0) vec4<f32> {
    return corner.colour;
}

// Faces: solid parallelograms.

struct Face {
    @location(0) centre: vec3<f32>,
    @location(1) first: vec3<f32>,
    @location(2) second: vec3<f32>,
    @location(3) colour: vec4<f32>,
}

@vertex
fn face_corner(@builtin(vertex_index) index: u32, face: Face) -> LineCorner {
    let at = vec2(f32(index & 1u), f32(index >> 1u)) * 2.0 - 1.0;
    let corner = face.centre + face.first * at.x + face.second * at.y;
    return LineCorner(to_clip(to_view(corner)), to_linear(face.colour));
}

// Discs: quads with a smooth rim, or a glow.

struct Disc {
    @location(0) centre: vec3<f32>,
    @location(1) radius: f32,
    @location(2) normal: vec3<f32>,
    // 0 for a disc with a rim, 1 for a glow.
    @location(3) glow: f32,
    @location(4) colour: vec4<f32>,
}

struct DiscCorner {
    @builtin(position) position: vec4<f32>,
    // Offset from the centre, in units of the radius.
    @location(0) at: vec2<f32>,
    @location(1) @interpolate(flat) colour: vec4<f32>,
    @location(2) @interpolate(flat) glow: f32,
}

// Half the side of the quad, in units of the radius: room for the smooth rim.
const RIM_ROOM = 1.2;

@vertex
fn disc_corner(@builtin(vertex_index) index: u32, disc: Disc) -> DiscCorner {
    let at = (vec2(f32(index & 1u), f32(index >> 1u)) * 2.0 - 1.0) * RIM_ROOM;
    var helper = vec3(1.0, 0.0, 0.0);
    if abs(disc.normal.x) > 0.7 {
        helper = vec3(0.0, 1.0, 0.0);
    }
    let across = normalize(cross(disc.normal, helper));
    let along = cross(disc.normal, across);
    let corner = disc.centre + (across * at.x + along * at.y) * disc.radius;
    return DiscCorner(to_clip(to_view(corner)), at, to_linear(disc.colour), disc.glow);
}

@fragment
fn disc(corner: DiscCorner) -> @location(0) vec4<f32> {
    let out = length(corner.at);
    let pixel = max(fwidth(out), 1e-6);
    let covered = clamp((1.0 - out) / pixel + 0.5, 0.0, 1.0);
    let rim = smoothstep(1.0 - max(0.14, 2.0 * pixel), 1.0 - 0.5 * pixel, out);
    let inner = max(1.0 - out, 0.0);
    let opacity = mix(covered * (0.45 + 0.55 * rim), inner * inner, corner.glow);
    return vec4(corner.colour.rgb, corner.colour.a * opacity);
}
