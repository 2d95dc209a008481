//! Finding a graphics adapter.

use std::sync::{Arc, Mutex, PoisonError};

use wgpu::DeviceType;

use crate::error::RenderError;

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
/// Kinds of adapters, the best first.
const BEST_FIRST: [DeviceType; 5] =
    [DeviceType::DiscreteGpu, DeviceType::IntegratedGpu, DeviceType::VirtualGpu, DeviceType::Other, DeviceType::Cpu];

/// What finds adapters, for pictures alone or for windows on a display.
pub(crate) fn instance(display: Option<Box<dyn wgpu::wgt::WgpuHasDisplayHandle>>) -> wgpu::Instance {
    let headless = wgpu::InstanceDescriptor::new_without_display_handle();
    wgpu::Instance::new(wgpu::InstanceDescriptor { backends: BACKENDS, display, ..headless })
}

/// That an adapter is gone.
pub(crate) fn lost() -> RenderError {
    RenderError::Driver("the graphics adapter was lost".to_owned())
}

/// That a driver failed, and said this.
pub(super) fn failed(said: impl std::fmt::Display) -> RenderError {
    RenderError::Driver(format!("the graphics driver failed: {said}"))
}

/// An adapter at work.
#[derive(Clone)]
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
        let memory_hints = wgpu::MemoryHints::MemoryUsage;
        let descriptor = wgpu::DeviceDescriptor { required_limits, memory_hints, ..wgpu::DeviceDescriptor::default() };
        let started = pollster::block_on(adapter.request_device(&descriptor));
        let (device, queue) = started.map_err(|error| unusable(&name, error))?;
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
        let (largest, adapter) = (self.largest_px, &self.name);
        if (1..=largest).contains(&width) && (1..=largest).contains(&height) {
            return Ok(());
        }
        let cannot = format!("a picture of {width} x {height} pixels cannot be drawn");
        Err(RenderError::PictureSize(format!("{cannot}: {adapter} draws from 1 to {largest} pixels a side")))
    }

    /// Whether the driver has failed since the last call.
    pub(crate) fn check(&self) -> Result<(), RenderError> {
        let trouble = self.trouble.lock().unwrap_or_else(PoisonError::into_inner).take();
        trouble.map_or(Ok(()), |said| Err(failed(said)))
    }
}

/// That the adapter of this name cannot be started.
pub(crate) fn unusable(adapter: &str, reason: impl std::fmt::Display) -> RenderError {
    RenderError::Driver(format!("the adapter {adapter} cannot be used: {reason}"))
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
    let kind = |adapter: &wgpu::Adapter| adapter.get_info().device_type;
    let mut adapters = pollster::block_on(instance.enumerate_adapters(BACKENDS));
    adapters.retain(|adapter| surface.is_none_or(|surface| adapter.is_surface_supported(surface)));
    adapters.sort_by_key(|adapter| BEST_FIRST.iter().position(|known| *known == kind(adapter)));
    let found: Vec<String> = adapters.iter().map(name).collect();
    let chosen = adapters.into_iter().find(|adapter| match choice {
        AdapterChoice::Best => true,
        AdapterChoice::Hardware => kind(adapter) != DeviceType::Cpu,
        AdapterChoice::Software => kind(adapter) == DeviceType::Cpu,
        AdapterChoice::Named(wanted) => name(adapter).to_lowercase().contains(&wanted.to_lowercase()),
    });
    chosen.ok_or_else(|| {
        let wanted = match choice {
            _ if found.is_empty() => return RenderError::NoAdapter,
            AdapterChoice::Best => "usable",
            AdapterChoice::Hardware => "hardware",
            AdapterChoice::Software => "software",
            AdapterChoice::Named(name) => &format!("`{name}`"),
        };
        RenderError::NoSuchAdapter(format!("there is no {wanted} adapter; there are: {}", found.join(", ")))
    })
}
