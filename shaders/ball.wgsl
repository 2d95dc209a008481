// Balls as flat pieces on which every pixel finds its own point of the sphere.

struct Ball {
    @location(0) centre: vec3<f32>,
    @location(1) radius: f32,
    @location(2) colour: vec4<f32>,
}

struct Corner {
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

// White light from above the camera's left shoulder.
const LIGHT = vec3(-0.408, 0.577, 0.707);
const AMBIENT = 0.38;
const GLOSS = 0.16;

@vertex
fn corner(@builtin(vertex_index) index: u32, ball: Ball) -> Corner {
    let side = vec2(f32(index & 1u), f32(index >> 1u)) * 2.0 - 1.0;
    let centre = seen(ball.centre);
    let distance = length(centre);
    var position: vec4<f32>;
    if is_perspective() && centre.z >= ball.radius {
        // All of it is behind the camera: outside the picture.
        position = vec4(2.0, 2.0, 2.0, 1.0);
    } else if is_perspective() && (distance < 1.001 * ball.radius || -centre.z < ball.radius) {
        // The camera is within the ball or beside it.
        position = vec4(side, 0.5, 1.0);
    } else if is_perspective() {
        // The circle in which the cone of sight around the ball cuts the plane through its centre, and a pixel more.
        let pixel = 2.0 * frame.lens.y * distance / frame.range.w;
        let axis = centre / distance;
        let across = normalize(cross(vec3(0.0, 1.0, 0.0), axis));
        let along = cross(axis, across);
        let sine = ball.radius / distance;
        let reach = ball.radius / sqrt(1.0 - sine * sine) + pixel;
        position = clipped(centre + (across * side.x + along * side.y) * reach);
    } else {
        let pixel = 2.0 * frame.lens.y / frame.range.w;
        position = clipped(centre + vec3(side * (ball.radius + pixel), 0.0));
    }
    // The depth is that of the sphere and found for each pixel.
    position.z = 0.5 * position.w;
    return Corner(position, centre, ball.radius, light_of(ball.colour));
}

struct Ray {
    origin: vec3<f32>,
    direction: vec3<f32>,
}

fn ray_at(pixel: vec2<f32>) -> Ray {
    let flat = (pixel / frame.range.zw * vec2(2.0, -2.0) + vec2(-1.0, 1.0)) * frame.lens.xy;
    if is_perspective() {
        return Ray(vec3(0.0), vec3(flat, -1.0));
    }
    return Ray(vec3(flat, 0.0), vec3(0.0, 0.0, -1.0));
}

// Squared half of the chord that a ball cuts from a ray. The vector from the centre to the ray is formed first:
// subtracting squares of distances would lose small balls far away.
fn chord(ray: Ray, centre: vec3<f32>, radius: f32) -> f32 {
    let to_origin = ray.origin - centre;
    let foot = to_origin - ray.direction * (dot(to_origin, ray.direction) / dot(ray.direction, ray.direction));
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

fn hit(corner: Corner) -> Hit {
    // Where the four samples of a pixel are.
    var offsets = array(vec2(0.375, 0.125), vec2(0.875, 0.375), vec2(0.125, 0.625), vec2(0.625, 0.875));
    let pixel = floor(corner.position.xy);
    var samples = 0u;
    for (var k = 0u; k < 4u; k++) {
        if chord(ray_at(pixel + offsets[k]), corner.centre, corner.radius) >= 0.0 {
            samples |= 1u << k;
        }
    }
    let ray = ray_at(pixel + 0.5);
    let squared = dot(ray.direction, ray.direction);
    let middle = -dot(ray.origin - corner.centre, ray.direction) / squared;
    let half = sqrt(max(chord(ray, corner.centre, corner.radius), 0.0) / squared);
    var along = middle - half;
    let inside = along < 0.0;
    if inside {
        along = middle + half;
    }
    if along < 0.0 {
        samples = 0u;
    }
    let at = ray.origin + ray.direction * along;
    let clip = clipped(at);
    let normal = normalize(at - corner.centre);
    return Hit(at, normal, -normalize(ray.direction), clamp(clip.z / clip.w, 0.0, 1.0), samples, inside);
}

@fragment
fn solid(corner: Corner) -> Shade {
    let hit = hit(corner);
    if hit.samples == 0u {
        discard;
    }
    let lit = AMBIENT + (1.0 - AMBIENT) * max(dot(hit.normal, LIGHT), 0.0);
    let gloss = GLOSS * pow(max(dot(hit.normal, normalize(LIGHT + hit.view)), 0.0), 48.0);
    return Shade(vec4(corner.colour.rgb * lit + gloss, 1.0), hit.depth, hit.samples);
}

@fragment
fn shell(corner: Corner) -> Shade {
    let hit = hit(corner);
    if hit.samples == 0u {
        discard;
    }
    let rim = 1.0 - abs(dot(hit.normal, hit.view));
    let opacity = corner.colour.a * (0.10 + 0.90 * rim * rim * rim);
    return Shade(vec4(corner.colour.rgb, opacity), hit.depth, hit.samples);
}
