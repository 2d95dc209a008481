//! Balls, shells and lines as instances.

use bytemuck::{Pod, Zeroable};
use nalgebra::Vector3;

use super::target::{DEPTH_FORMAT, LIGHT_FORMAT, SAMPLES, Target};
use crate::render::scene::{Ball, Lens, Line, Scene};

/// Instances that a buffer holds at first.
const FIRST_INSTANCES: usize = 256;

/// `Frame` in shaders/frame.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Frame {
    right: [f32; 4],
    up: [f32; 4],
    back: [f32; 4],
    eye: [f32; 4],
    lens: [f32; 4],
    range: [f32; 4],
}

/// `Ball` in shaders/ball.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct BallInstance {
    centre: [f32; 3],
    radius: f32,
    colour: [u8; 4],
}

/// `Line` in shaders/line.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct LineInstance {
    ends: [[f32; 3]; 2],
    colours: [[u8; 4]; 2],
    width: f32,
}

impl From<&Ball> for BallInstance {
    fn from(ball: &Ball) -> Self {
        Self { centre: ball.centre_m, radius: ball.radius_m, colour: ball.colour.rgba }
    }
}

impl From<&Line> for LineInstance {
    fn from(line: &Line) -> Self {
        Self { ends: line.ends_m, colours: line.colours.map(|colour| colour.rgba), width: line.width_px }
    }
}

impl Frame {
    fn of(scene: &Scene) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "the draw list is in single precision")]
        let single = |x: f64| x as f32;
        let wide = |v: Vector3<f64>| [single(v.x), single(v.y), single(v.z), 0.0];
        let camera = &scene.camera;
        let (half, perspective) = match camera.lens {
            Lens::Perspective(half) => (half, 1.0),
            Lens::Parallel(half) => (half, 0.0),
        };
        let [width, height] = camera.size_px.map(|size| size as f32);
        Self {
            right: wide(camera.right),
            up: wide(camera.up),
            back: wide(camera.back),
            eye: wide(camera.eye_m),
            lens: [single(half[0]), single(half[1]), perspective, 0.0],
            range: [single(scene.depth_m[0]), single(scene.depth_m[1]), width, height],
        }
    }
}

/// Instances on the adapter.
struct Instances {
    label: &'static str,
    buffer: wgpu::Buffer,
    count: u32,
}

impl Instances {
    fn new(device: &wgpu::Device, label: &'static str, bytes: usize) -> Self {
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes as u64,
            usage: wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        Self { label, buffer, count: 0 }
    }

    fn upload<T: Pod>(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, instances: &[T]) {
        let bytes: &[u8] = bytemuck::cast_slice(instances);
        if bytes.len() as u64 > self.buffer.size() {
            *self = Self::new(device, self.label, bytes.len().next_power_of_two());
        }
        if !bytes.is_empty() {
            queue.write_buffer(&self.buffer, 0, bytes);
        }
        self.count = u32::try_from(instances.len()).unwrap_or(u32::MAX);
    }
}

/// Everything that draws the world.
pub(super) struct Pipelines {
    frame: wgpu::Buffer,
    frame_group: wgpu::BindGroup,
    solid: wgpu::RenderPipeline,
    line: wgpu::RenderPipeline,
    shell: wgpu::RenderPipeline,
    balls: Instances,
    lines: Instances,
    shells: Instances,
}

impl Pipelines {
    pub(super) fn new(device: &wgpu::Device) -> Self {
        let frame = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("frame"),
            size: size_of::<Frame>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let entry = wgpu::BindGroupLayoutEntry {
            binding: 0,
            visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Uniform,
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        };
        let group_layout = device
            .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("frame"), entries: &[entry] });
        let frame_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("frame"),
            layout: &group_layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: frame.as_entire_binding() }],
        });
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("world"),
            bind_group_layouts: &[Some(&group_layout)],
            immediate_size: 0,
        });
        let shader = |label, source: &str| {
            device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(label),
                source: wgpu::ShaderSource::Wgsl(source.into()),
            })
        };
        let ball_shader = shader(
            "ball",
            concat!(include_str!("../../../shaders/frame.wgsl"), include_str!("../../../shaders/ball.wgsl")),
        );
        let line_shader = shader(
            "line",
            concat!(include_str!("../../../shaders/frame.wgsl"), include_str!("../../../shaders/line.wgsl")),
        );
        let ball_attributes = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32, 2 => Unorm8x4];
        let line_attributes =
            wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Unorm8x4, 3 => Unorm8x4, 4 => Float32];
        let pipeline = |label, module: &wgpu::ShaderModule, attributes: &[_], stride: usize, entry, writes_depth| {
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(label),
                layout: Some(&layout),
                vertex: wgpu::VertexState {
                    module,
                    entry_point: Some("corner"),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    buffers: &[Some(wgpu::VertexBufferLayout {
                        array_stride: stride as u64,
                        step_mode: wgpu::VertexStepMode::Instance,
                        attributes,
                    })],
                },
                primitive: wgpu::PrimitiveState {
                    topology: wgpu::PrimitiveTopology::TriangleStrip,
                    ..wgpu::PrimitiveState::default()
                },
                depth_stencil: Some(wgpu::DepthStencilState {
                    format: DEPTH_FORMAT,
                    depth_write_enabled: Some(writes_depth),
                    depth_compare: Some(wgpu::CompareFunction::Greater),
                    stencil: wgpu::StencilState::default(),
                    bias: wgpu::DepthBiasState::default(),
                }),
                multisample: wgpu::MultisampleState { count: SAMPLES, ..wgpu::MultisampleState::default() },
                fragment: Some(wgpu::FragmentState {
                    module,
                    entry_point: Some(entry),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    targets: &[Some(wgpu::ColorTargetState {
                        format: LIGHT_FORMAT,
                        blend: Some(OVER),
                        write_mask: wgpu::ColorWrites::ALL,
                    })],
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        let (ball_bytes, line_bytes) = (size_of::<BallInstance>(), size_of::<LineInstance>());
        Self {
            solid: pipeline("solid", &ball_shader, &ball_attributes, ball_bytes, "solid", true),
            line: pipeline("line", &line_shader, &line_attributes, line_bytes, "stroke", false),
            shell: pipeline("shell", &ball_shader, &ball_attributes, ball_bytes, "shell", false),
            balls: Instances::new(device, "balls", FIRST_INSTANCES * ball_bytes),
            lines: Instances::new(device, "lines", FIRST_INSTANCES * line_bytes),
            shells: Instances::new(device, "shells", FIRST_INSTANCES * ball_bytes),
            frame,
            frame_group,
        }
    }

    pub(super) fn upload(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, scene: &Scene) {
        queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&Frame::of(scene)));
        let balls = |balls: &[Ball]| balls.iter().map(BallInstance::from).collect::<Vec<_>>();
        self.balls.upload(device, queue, &balls(&scene.balls));
        self.shells.upload(device, queue, &balls(&scene.shells));
        self.lines.upload(device, queue, &scene.lines.iter().map(LineInstance::from).collect::<Vec<_>>());
    }

    /// Draws what was uploaded last: solid things first, then what lets light through. Lines hide nothing: of two on one
    /// another, the later one is seen.
    pub(super) fn draw(&self, encoder: &mut wgpu::CommandEncoder, target: &Target, scene: &Scene) {
        let [red, green, blue, _] = scene.background.linear().map(f64::from);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("world"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &target.samples_view,
                depth_slice: None,
                resolve_target: Some(&target.light_view),
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color { r: red, g: green, b: blue, a: 1.0 }),
                    store: wgpu::StoreOp::Discard,
                },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &target.depth_view,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Discard }),
                stencil_ops: None,
            }),
            ..wgpu::RenderPassDescriptor::default()
        });
        pass.set_bind_group(0, &self.frame_group, &[]);
        for (pipeline, instances) in
            [(&self.solid, &self.balls), (&self.line, &self.lines), (&self.shell, &self.shells)]
        {
            if instances.count > 0 {
                pass.set_pipeline(pipeline);
                pass.set_vertex_buffer(0, instances.buffer.slice(..));
                pass.draw(0..4, 0..instances.count);
            }
        }
    }
}

/// Light through what is in front, and the picture itself opaque.
const OVER: wgpu::BlendState = wgpu::BlendState {
    color: wgpu::BlendState::ALPHA_BLENDING.color,
    alpha: wgpu::BlendComponent {
        src_factor: wgpu::BlendFactor::One,
        dst_factor: wgpu::BlendFactor::OneMinusSrcAlpha,
        operation: wgpu::BlendOperation::Add,
    },
};
