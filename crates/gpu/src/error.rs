//! What can go wrong between a program and its graphics device.

/// Why the device could not do something.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GpuError {
    /// No driver offers an adapter.
    #[error(
        "no graphics adapter found: install a Vulkan driver; on Debian or Ubuntu without a graphics card: \
         apt-get install mesa-vulkan-drivers libvulkan1"
    )]
    NoAdapter,
    /// The adapter exists but would not open.
    #[error("{adapter} would not open: {reason}; try another adapter or a newer driver")]
    Open {
        /// The adapter's name.
        adapter: String,
        /// The driver's words.
        reason: String,
    },
    /// A shader or pipeline did not pass validation.
    #[error("{label} does not compile: {reason}")]
    Shader {
        /// Name of the kernel or pipeline.
        label: String,
        /// The compiler's words.
        reason: String,
    },
    /// Resources do not fit the slots of their shader.
    #[error("{label}: {reason}")]
    Bind {
        /// Name of the kernel or pipeline.
        label: String,
        /// What does not fit.
        reason: String,
    },
    /// A buffer or texture is larger than the device allows.
    #[error("{label} needs {wanted} {unit}, but {adapter} allows {limit}; use a smaller one or another device")]
    TooLarge {
        /// Name of the resource.
        label: String,
        /// What was asked for.
        wanted: u64,
        /// What there is.
        limit: u64,
        /// Bytes or texels along an edge.
        unit: &'static str,
        /// The adapter's name.
        adapter: String,
    },
    /// The device did not answer in time, or is gone.
    #[error("the graphics device does not answer ({0}); it may have been reset or removed")]
    Lost(String),
}
