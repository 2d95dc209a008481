//! Selection and start of a graphics adapter.

use std::sync::{Arc, Mutex, PoisonError};

use wgpu::DeviceType;

use crate::error::{RenderError, check_size};

/// Choice of the adapter.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum AdapterChoice {
    /// Best adapter: hardware first, then software drivers, then none.
    #[default]
    Best,
    /// Hardware only.
    Hardware,
    /// Software drivers only.
    Software,
    /// No adapter: the program draws on the processor.
    None,
    /// First adapter whose name contains this text, case-insensitive.
    Named(String),
}

impl From<&str> for AdapterChoice {
    fn from(text: &str) -> Self {
        match text {
            "" | "best" => Self::Best,
            "hardware" => Self::Hardware,
            "software" => Self::Software,
            "none" => Self::None,
            name => Self::Named(name.to_owned()),
        }
    }
}

impl AdapterChoice {
    /// Checks that an adapter of this name or type exists. The other choices need none.
    ///
    /// # Errors
    /// [`RenderError::NoSuchAdapter`] with the names that exist, or [`RenderError::NoAdapter`] if the machine has none.
    pub fn check(&self) -> Result<(), RenderError> {
        match self {
            Self::Best | Self::None => Ok(()),
            Self::Hardware | Self::Software | Self::Named(_) => pick(&instance(None), self, None).map(drop),
        }
    }
}

/// Graphics APIs. OpenGL is excluded: its shaders cannot set the sample mask that balls need.
const BACKENDS: wgpu::Backends = wgpu::Backends::PRIMARY;
/// Device types, best first.
const BEST_FIRST: [DeviceType; 5] =
    [DeviceType::DiscreteGpu, DeviceType::IntegratedGpu, DeviceType::VirtualGpu, DeviceType::Other, DeviceType::Cpu];

/// Creates an instance that finds adapters, for off-screen pictures or for windows on a display.
pub(crate) fn instance(display: Option<Box<dyn wgpu::wgt::WgpuHasDisplayHandle>>) -> wgpu::Instance {
    let headless = wgpu::InstanceDescriptor::new_without_display_handle();
    wgpu::Instance::new(wgpu::InstanceDescriptor { backends: BACKENDS, display, ..headless })
}

/// Returns the error of a lost adapter.
pub(crate) fn lost() -> RenderError {
    RenderError::Driver("the graphics adapter was lost".to_owned())
}

/// Returns the error of a failed driver.
pub(super) fn failed(message: impl std::fmt::Display) -> RenderError {
    RenderError::Driver(format!("the graphics driver failed: {message}"))
}

/// Started adapter.
#[derive(Clone)]
pub(crate) struct Gpu {
    pub(crate) name: String,
    pub(crate) largest_px: u32,
    #[cfg(feature = "window")]
    pub(crate) adapter: wgpu::Adapter,
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    /// First uncaptured error of the driver.
    uncaptured_error: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// Starts the best adapter of a choice. With a surface, the adapter must be able to draw on it.
    pub(crate) fn open(
        instance: &wgpu::Instance,
        choice: &AdapterChoice,
        surface: Option<&wgpu::Surface<'_>>,
    ) -> Result<Self, RenderError> {
        let adapter = pick(instance, choice, surface)?;
        let name = name(&adapter);
        let limits = adapter.limits();
        // Full limits would depend on the adapter; pictures need only these.
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
        let uncaptured_error = Arc::new(Mutex::new(None));
        let kept = Arc::clone(&uncaptured_error);
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
            uncaptured_error,
        })
    }

    pub(crate) fn check_size(&self, size_px: [u32; 2]) -> Result<(), RenderError> {
        check_size(size_px, self.largest_px, &self.name)
    }

    /// Checks that the driver has not failed since the last call.
    pub(crate) fn check(&self) -> Result<(), RenderError> {
        let uncaptured_error = self.uncaptured_error.lock().unwrap_or_else(PoisonError::into_inner).take();
        uncaptured_error.map_or(Ok(()), |message| Err(failed(message)))
    }
}

/// Returns the error of an adapter that cannot be started.
pub(crate) fn unusable(adapter: &str, reason: impl std::fmt::Display) -> RenderError {
    RenderError::Driver(format!("the adapter {adapter} cannot be used: {reason}"))
}

fn name(adapter: &wgpu::Adapter) -> String {
    let info = adapter.get_info();
    format!("{} ({:?}, {:?})", info.name, info.device_type, info.backend)
}

/// Returns the names of the graphics adapters that can draw, best first.
#[must_use]
pub fn adapters() -> Vec<String> {
    best_first(&instance(None)).iter().map(name).collect()
}

fn device_type(adapter: &wgpu::Adapter) -> DeviceType {
    adapter.get_info().device_type
}

fn best_first(instance: &wgpu::Instance) -> Vec<wgpu::Adapter> {
    let mut adapters = pollster::block_on(instance.enumerate_adapters(BACKENDS));
    adapters.sort_by_key(|adapter| BEST_FIRST.iter().position(|known| *known == device_type(adapter)));
    adapters
}

/// Returns the best adapter of a choice.
fn pick(
    instance: &wgpu::Instance,
    choice: &AdapterChoice,
    surface: Option<&wgpu::Surface<'_>>,
) -> Result<wgpu::Adapter, RenderError> {
    let mut adapters = best_first(instance);
    adapters.retain(|adapter| surface.is_none_or(|surface| adapter.is_surface_supported(surface)));
    let found: Vec<String> = adapters.iter().map(name).collect();
    let chosen = adapters.into_iter().find(|adapter| match choice {
        AdapterChoice::Best => true,
        AdapterChoice::Hardware => device_type(adapter) != DeviceType::Cpu,
        AdapterChoice::Software => device_type(adapter) == DeviceType::Cpu,
        AdapterChoice::None => false,
        AdapterChoice::Named(wanted) => name(adapter).to_lowercase().contains(&wanted.to_lowercase()),
    });
    chosen.ok_or_else(|| {
        let wanted = match choice {
            _ if found.is_empty() => return RenderError::NoAdapter,
            AdapterChoice::Best | AdapterChoice::None => "usable",
            AdapterChoice::Hardware => "hardware",
            AdapterChoice::Software => "software",
            AdapterChoice::Named(name) => &format!("`{name}`"),
        };
        RenderError::NoSuchAdapter(format!("there is no {wanted} adapter; there are: {}", found.join(", ")))
    })
}
