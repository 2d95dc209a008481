// Straight lines of a width in pixels.

struct Line {
    @location(0) first: vec3<f32>,
    @location(1) second: vec3<f32>,
    @location(2) first_colour: vec4<f32>,
    @location(3) second_colour: vec4<f32>,
    @location(4) width: f32,
}

struct Corner {
    @builtin(position) position: vec4<f32>,
    @location(0) colour: vec4<f32>,
}

// The part of the line that is ahead of the camera.
fn ahead(point: vec3<f32>, other: vec3<f32>) -> vec3<f32> {
    let near = frame.range.x;
    if !is_perspective() || -point.z >= near || -other.z <= near {
        return point;
    }
    return mix(point, other, (near + point.z) / (point.z - other.z));
}

@vertex
fn corner(@builtin(vertex_index) index: u32, line: Line) -> Corner {
    let first = seen(line.first);
    let second = seen(line.second);
    let ends = array(clipped(ahead(first, second)), clipped(ahead(second, first)));
    let half_size = frame.range.zw / 2.0;
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
    return Corner(position, light_of(colour));
}

@fragment
fn stroke(corner: Corner) -> @location(0) vec4<f32> {
    return corner.colour;
}
