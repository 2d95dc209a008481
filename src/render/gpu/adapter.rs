//! Finding a graphics adapter.

use std::sync::{Arc, Mutex, PoisonError};

use crate::render::error::RenderError;

/// Which adapter draws.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum AdapterChoice {
    /// The best there is: hardware first, then software.
    #[default]
    Best,
    /// Hardware alone.
    Hardware,
    /// A driver in software alone.
    Software,
    /// The first whose name contains these words, whatever their case.
    Named(String),
}

impl From<&str> for AdapterChoice {
    fn from(text: &str) -> Self {
        match text {
            "" | "best" => Self::Best,
            "hardware" => Self::Hardware,
            "software" => Self::Software,
            name => Self::Named(name.to_owned()),
        }
    }
}

/// Ways to speak to adapters. OpenGL is none of them: it cannot say which samples of a pixel a ball covers.
const BACKENDS: wgpu::Backends = wgpu::Backends::PRIMARY;

/// What finds adapters, for pictures alone or for windows on a display.
pub(crate) fn instance(display: Option<Box<dyn wgpu::wgt::WgpuHasDisplayHandle>>) -> wgpu::Instance {
    let headless = wgpu::InstanceDescriptor::new_without_display_handle();
    wgpu::Instance::new(wgpu::InstanceDescriptor { backends: BACKENDS, display, ..headless })
}

/// An adapter at work.
pub(crate) struct Gpu {
    pub(crate) name: String,
    pub(crate) largest_px: u32,
    #[cfg(feature = "window")]
    pub(crate) adapter: wgpu::Adapter,
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    /// The first error that nobody asked for.
    trouble: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// Starts the best adapter of a choice, for a surface one that can show what it draws on it.
    pub(crate) fn open(
        instance: &wgpu::Instance,
        choice: &AdapterChoice,
        surface: Option<&wgpu::Surface<'_>>,
    ) -> Result<Self, RenderError> {
        let adapter = pick(instance, choice, surface)?;
        let name = name(&adapter);
        let limits = adapter.limits();
        // The limits of the adapter itself would forbid another one to do the same; a picture needs few of them.
        let required_limits = wgpu::Limits {
            max_texture_dimension_2d: limits.max_texture_dimension_2d,
            max_buffer_size: limits.max_buffer_size,
            ..wgpu::Limits::downlevel_defaults().using_resolution(limits)
        };
        let largest_px = required_limits.max_texture_dimension_2d;
        let descriptor = wgpu::DeviceDescriptor {
            required_limits,
            memory_hints: wgpu::MemoryHints::MemoryUsage,
            ..wgpu::DeviceDescriptor::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|error| RenderError::UnusableAdapter { adapter: name.clone(), reason: error.to_string() })?;
        let trouble = Arc::new(Mutex::new(None));
        let kept = Arc::clone(&trouble);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            kept.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_with(|| error.to_string());
        }));
        Ok(Self {
            name,
            largest_px,
            #[cfg(feature = "window")]
            adapter,
            device,
            queue,
            trouble,
        })
    }

    pub(crate) fn check_size(&self, [width, height]: [u32; 2]) -> Result<(), RenderError> {
        let largest = self.largest_px;
        if (1..=largest).contains(&width) && (1..=largest).contains(&height) {
            return Ok(());
        }
        Err(RenderError::PictureSize { width, height, largest, adapter: self.name.clone() })
    }

    /// Whether the driver has failed since the last call.
    pub(crate) fn check(&self) -> Result<(), RenderError> {
        let trouble = self.trouble.lock().unwrap_or_else(PoisonError::into_inner).take();
        trouble.map_or(Ok(()), |reason| Err(RenderError::Driver(reason)))
    }
}

fn name(adapter: &wgpu::Adapter) -> String {
    let info = adapter.get_info();
    format!("{} ({:?}, {:?})", info.name, info.device_type, info.backend)
}

/// The first adapter of a choice, the best first.
fn pick(
    instance: &wgpu::Instance,
    choice: &AdapterChoice,
    surface: Option<&wgpu::Surface<'_>>,
) -> Result<wgpu::Adapter, RenderError> {
    let mut adapters = pollster::block_on(instance.enumerate_adapters(BACKENDS));
    adapters.retain(|adapter| surface.is_none_or(|surface| adapter.is_surface_supported(surface)));
    adapters.sort_by_key(|adapter| rank(adapter.get_info().device_type));
    let found: Vec<String> = adapters.iter().map(name).collect();
    let chosen = adapters.into_iter().find(|adapter| {
        let is_software = adapter.get_info().device_type == wgpu::DeviceType::Cpu;
        match choice {
            AdapterChoice::Best => true,
            AdapterChoice::Hardware => !is_software,
            AdapterChoice::Software => is_software,
            AdapterChoice::Named(wanted) => name(adapter).to_lowercase().contains(&wanted.to_lowercase()),
        }
    });
    chosen.ok_or_else(|| {
        let wanted = match choice {
            _ if found.is_empty() => return RenderError::NoAdapter,
            AdapterChoice::Best => "usable".to_owned(),
            AdapterChoice::Hardware => "hardware".to_owned(),
            AdapterChoice::Software => "software".to_owned(),
            AdapterChoice::Named(name) => format!("`{name}`"),
        };
        RenderError::NoSuchAdapter { wanted, found: found.join(", ") }
    })
}

fn rank(device_type: wgpu::DeviceType) -> u8 {
    match device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}
