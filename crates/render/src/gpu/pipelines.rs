//! Render pipelines of balls, faces, discs, shells and lines as instances.

use bytemuck::Pod;
use nalgebra::Vector3;
use wgpu::util::{BufferInitDescriptor, DeviceExt as _};

use super::adapter::Gpu;
use super::{DEPTH_FORMAT, LIGHT_FORMAT, SAMPLES, Target};
use crate::scene::{Ball, Disc, Face, Lens, Line, Scene};
use crate::software::{AMBIENT, GLOSS, SHININESS};
use tautline_report::drawing::LIGHT;

const SHADERS: &str = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/", env!("TAUTLINE_SHADERS"), "/scene.wgsl"));

/// Uniform `Camera` of shaders/scene.wgsl: right, up, back, eye, lens and range.
type CameraUniform = [[f32; 4]; 6];

fn camera_uniform(scene: &Scene) -> CameraUniform {
    #[expect(clippy::cast_possible_truncation, reason = "the adapter works in single precision")]
    let single = |x: f64| x as f32;
    let wide = |v: Vector3<f64>| [single(v.x), single(v.y), single(v.z), 0.0];
    let camera = &scene.camera;
    let (half, perspective) = match camera.lens {
        Lens::Perspective(half) => (half, 1.0),
        Lens::Parallel(half) => (half, 0.0),
    };
    let [width, height] = camera.size_px.map(|size| size as f32);
    let lens = [single(half[0]), single(half[1]), perspective, scene.shell_ratio];
    let range = [single(scene.depth_m[0]), single(scene.depth_m[1]), width, height];
    [wide(camera.right), wide(camera.up), wide(camera.back), wide(camera.eye_m), lens, range]
}

/// Pipeline with its camera binding.
struct DrawCall {
    pipeline: wgpu::RenderPipeline,
    camera: wgpu::BindGroup,
}

impl DrawCall {
    /// Draws a strip of four corners for each instance.
    fn draw<T: Pod>(&self, gpu: &Gpu, pass: &mut wgpu::RenderPass<'_>, instances: &[T]) {
        if instances.is_empty() {
            return;
        }
        let (contents, usage) = (bytemuck::cast_slice(instances), wgpu::BufferUsages::VERTEX);
        let buffer = gpu.device.create_buffer_init(&BufferInitDescriptor { label: Some("instances"), contents, usage });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.camera, &[]);
        pass.set_vertex_buffer(0, buffer.slice(..));
        pass.draw(0..4, 0..u32::try_from(instances.len()).unwrap_or(u32::MAX));
    }
}

/// Pipelines of all elements with a position in space.
pub(super) struct Pipelines {
    camera: wgpu::Buffer,
    balls: DrawCall,
    faces: DrawCall,
    lines: DrawCall,
    discs: DrawCall,
    shells: DrawCall,
}

impl Pipelines {
    pub(super) fn new(device: &wgpu::Device) -> Self {
        let camera = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("camera"),
            size: size_of::<CameraUniform>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let [x, y, z] = LIGHT;
        let source = format!(
            "const LIGHT = vec3({x:?}, {y:?}, {z:?});\nconst AMBIENT = {AMBIENT:?};\nconst GLOSS = {GLOSS:?};\n\
             const SHININESS = {SHININESS}.0;\n{SHADERS}"
        );
        let source = wgpu::ShaderSource::Wgsl(source.into());
        let shaders = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some("scene"), source });
        let call = |corner, pixel, attributes: &[_], bytes: usize, writes_depth| {
            let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(pixel),
                layout: None,
                vertex: wgpu::VertexState {
                    module: &shaders,
                    entry_point: Some(corner),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    buffers: &[Some(wgpu::VertexBufferLayout {
                        array_stride: bytes as u64,
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
                    module: &shaders,
                    entry_point: Some(pixel),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    targets: &[Some(wgpu::ColorTargetState {
                        format: LIGHT_FORMAT,
                        blend: Some(wgpu::BlendState::ALPHA_BLENDING),
                        write_mask: wgpu::ColorWrites::ALL,
                    })],
                }),
                multiview_mask: None,
                cache: None,
            });
            let camera = device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("camera"),
                layout: &pipeline.get_bind_group_layout(0),
                entries: &[wgpu::BindGroupEntry { binding: 0, resource: camera.as_entire_binding() }],
            });
            DrawCall { pipeline, camera }
        };
        let ball = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32, 2 => Unorm8x4];
        let disc = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32, 2 => Float32x3, 3 => Float32, 4 => Unorm8x4];
        let face = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x3, 3 => Unorm8x4];
        let line = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Unorm8x4, 3 => Unorm8x4, 4 => Float32];
        Self {
            balls: call("ball_corner", "solid", &ball, size_of::<Ball>(), true),
            faces: call("face_corner", "stroke", &face, size_of::<Face>(), true),
            discs: call("disc_corner", "disc", &disc, size_of::<Disc>(), false),
            lines: call("line_corner", "stroke", &line, size_of::<Line>(), false),
            shells: call("shell_corner", "shell", &ball, size_of::<Ball>(), false),
            camera,
        }
    }

    /// Draws solid elements first, then transparent ones. Lines do not hide each other: the later line is on top.
    pub(super) fn draw(&mut self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder, target: &Target, scene: &Scene) {
        gpu.queue.write_buffer(&self.camera, 0, bytemuck::bytes_of(&camera_uniform(scene)));
        let [r, g, b, _] = scene.background.linear().map(f64::from);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("scene"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &target.samples_view,
                depth_slice: None,
                resolve_target: Some(&target.light_view),
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a: 1.0 }),
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
        self.balls.draw(gpu, &mut pass, &scene.balls);
        self.faces.draw(gpu, &mut pass, &scene.faces);
        self.lines.draw(gpu, &mut pass, &scene.lines);
        self.discs.draw(gpu, &mut pass, &scene.discs);
        self.shells.draw(gpu, &mut pass, &scene.shells);
    }
}
