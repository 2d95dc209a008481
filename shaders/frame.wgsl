// What every shader knows of a picture. Coordinates "seen" are the camera's: right, up, towards it, in metres.

struct Frame {
    right: vec4<f32>,
    up: vec4<f32>,
    back: vec4<f32>,
    eye: vec4<f32>,
    // Half of width and height (tangents in perspective, metres in parallel projection), 1 in perspective, unused.
    lens: vec4<f32>,
    // Nearest and farthest depth in metres, width and height in pixels.
    range: vec4<f32>,
}

@group(0) @binding(0) var<uniform> frame: Frame;

fn seen(point: vec3<f32>) -> vec3<f32> {
    let from_eye = point - frame.eye.xyz;
    return vec3(dot(frame.right.xyz, from_eye), dot(frame.up.xyz, from_eye), dot(frame.back.xyz, from_eye));
}

fn is_perspective() -> bool {
    return frame.lens.z > 0.5;
}

// Depth is 1 at the nearest and 0 at the farthest, so that floating point is as fine as the view is near.
fn clipped(at: vec3<f32>) -> vec4<f32> {
    let near = frame.range.x;
    let far = frame.range.y;
    let flat = at.xy / frame.lens.xy;
    let depth = (far + at.z) / (far - near);
    if is_perspective() {
        return vec4(flat, near * depth, -at.z);
    }
    return vec4(flat, depth, 1.0);
}

// IEC 61966-2-1.
fn light_of(srgb: vec4<f32>) -> vec4<f32> {
    let low = srgb.rgb / 12.92;
    let high = pow((srgb.rgb + 0.055) / 1.055, vec3(2.4));
    return vec4(select(high, low, srgb.rgb <= vec3(0.04045)), srgb.a);
}
