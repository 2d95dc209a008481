//! Finding a graphics adapter.

use std::str::FromStr;
use std::sync::{Arc, Mutex, PoisonError};

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

impl FromStr for AdapterChoice {
    type Err = std::convert::Infallible;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Ok(match text {
            "" | "best" => Self::Best,
            "hardware" => Self::Hardware,
            "software" => Self::Software,
            name => Self::Named(name.to_owned()),
        })
    }
}

/// Ways to speak to adapters. OpenGL is none of them: it cannot say which samples of a pixel a ball covers.
pub(crate) const BACKENDS: wgpu::Backends = wgpu::Backends::PRIMARY;

/// Why nothing can be drawn.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GpuError {
    /// The machine has no adapter at all.
    #[error("this machine has no graphics adapter and no driver in software")]
    NoAdapter,
    /// It has adapters, but not of this choice.
    #[error("there is no {wanted} adapter; there are: {found}")]
    NoSuchAdapter {
        /// What was asked for.
        wanted: String,
        /// Names of those that there are.
        found: String,
    },
    /// The adapter cannot be started.
    #[error("the adapter {adapter} cannot be used: {reason}")]
    Unusable {
        /// Its name.
        adapter: String,
        /// What the driver said.
        reason: String,
    },
    /// A picture of this size cannot be drawn.
    #[error(
        "a picture of {width} x {height} pixels cannot be drawn: {adapter} draws from 1 to {largest} pixels a side"
    )]
    Size {
        /// Width asked for.
        width: u32,
        /// Height asked for.
        height: u32,
        /// Largest side.
        largest: u32,
        /// Name of the adapter.
        adapter: String,
    },
    /// The adapter failed while drawing.
    #[error("the graphics driver failed: {reason}")]
    Driver {
        /// What it said.
        reason: String,
    },
    /// The adapter is gone.
    #[error("the graphics adapter was lost")]
    Lost,
}

impl GpuError {
    /// What helps where there is no adapter.
    pub const HELP: &'static str =
        "install a driver; one in software is in Debian's packages: apt-get install mesa-vulkan-drivers libvulkan1";
}

/// An adapter at work.
pub(crate) struct Gpu {
    pub(crate) name: String,
    pub(crate) largest_px: u32,
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    /// The first error that nobody asked for.
    trouble: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    pub(super) fn open(choice: &AdapterChoice) -> Result<Self, GpuError> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = BACKENDS;
        Self::start(&pick(&wgpu::Instance::new(descriptor), choice, None)?)
    }

    /// An adapter that can show what it draws on a surface.
    pub(crate) fn open_for(
        instance: &wgpu::Instance,
        surface: &wgpu::Surface<'_>,
        choice: &AdapterChoice,
    ) -> Result<(Self, wgpu::SurfaceCapabilities), GpuError> {
        let adapter = pick(instance, choice, Some(surface))?;
        let capabilities = surface.get_capabilities(&adapter);
        Ok((Self::start(&adapter)?, capabilities))
    }

    fn start(adapter: &wgpu::Adapter) -> Result<Self, GpuError> {
        let name = name(adapter);
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
            .map_err(|error| GpuError::Unusable { adapter: name.clone(), reason: error.to_string() })?;
        let trouble = Arc::new(Mutex::new(None));
        let kept = Arc::clone(&trouble);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            kept.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_with(|| error.to_string());
        }));
        Ok(Self { name, largest_px, device, queue, trouble })
    }

    pub(crate) fn check_size(&self, [width, height]: [u32; 2]) -> Result<(), GpuError> {
        let largest = self.largest_px;
        if (1..=largest).contains(&width) && (1..=largest).contains(&height) {
            return Ok(());
        }
        Err(GpuError::Size { width, height, largest, adapter: self.name.clone() })
    }

    /// Whether the driver has failed since the last call.
    pub(crate) fn check(&self) -> Result<(), GpuError> {
        let trouble = self.trouble.lock().unwrap_or_else(PoisonError::into_inner).take();
        trouble.map_or(Ok(()), |reason| Err(GpuError::Driver { reason }))
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
) -> Result<wgpu::Adapter, GpuError> {
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
    chosen.ok_or_else(|| not_found(choice, &found))
}

fn not_found(choice: &AdapterChoice, found: &[String]) -> GpuError {
    if found.is_empty() {
        return GpuError::NoAdapter;
    }
    let wanted = match choice {
        AdapterChoice::Best => "usable".to_owned(),
        AdapterChoice::Hardware => "hardware".to_owned(),
        AdapterChoice::Software => "software".to_owned(),
        AdapterChoice::Named(name) => format!("`{name}`"),
    };
    GpuError::NoSuchAdapter { wanted, found: found.join(", ") }
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
