//! Errors of the graphics device.

/// Why a device operation failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GpuError {
    /// No driver offers an adapter.
    #[error(
        "no graphics adapter found: install a Vulkan driver; on Debian or Ubuntu without a graphics card: \
         apt-get install mesa-vulkan-drivers libvulkan1"
    )]
    NoAdapter,
    /// The adapter could not be opened.
    #[error("{adapter} would not open: {reason}; try another adapter or a newer driver")]
    Open {
        /// The adapter's name.
        adapter: String,
        /// The driver's message.
        reason: String,
    },
    /// A shader or pipeline failed validation.
    #[error("{label} does not compile: {reason}")]
    Shader {
        /// Name of the kernel or pipeline.
        label: String,
        /// The compiler's message.
        reason: String,
    },
    /// Resources do not match the slots of their shader.
    #[error("{label}: {reason}")]
    Bind {
        /// Name of the kernel or pipeline.
        label: String,
        /// The mismatch.
        reason: String,
    },
    /// A buffer or texture is larger than the device allows.
    #[error("{label} needs {wanted} {unit}, but {adapter} allows {limit}; use a smaller one or another device")]
    TooLarge {
        /// Name of the resource.
        label: String,
        /// The requested size.
        wanted: u64,
        /// The limit.
        limit: u64,
        /// Bytes or texels along an edge.
        unit: &'static str,
        /// The adapter's name.
        adapter: String,
    },
    /// The device did not answer in time, or was lost.
    #[error("the graphics device does not answer ({0}); it may have been reset or removed")]
    Lost(String),
}
