//! The plan of sizes: every buffer that a run makes on the device, known before it is made.

use ash::vk;
use bytemuck::Pod;

use crate::gpu::Buffer;

/// Size of one buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "train", derive(serde::Serialize))]
pub struct Planned {
    /// The buffer's debug name.
    pub name: &'static str,
    /// Number of elements.
    pub elements: u64,
    /// Bytes per element.
    pub element_bytes: u64,
}

impl Planned {
    /// Bytes of device memory.
    pub fn bytes(&self) -> u64 {
        // At least one element: Vulkan has no empty buffers.
        self.elements.max(1).saturating_mul(self.element_bytes)
    }
}

/// A list of buffers with their sizes.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Plan(pub Vec<Planned>);

/// Bytes of device memory.
impl Plan {
    /// Total bytes of all its buffers.
    pub fn bytes(&self) -> u64 {
        self.0.iter().map(Planned::bytes).fold(0, u64::saturating_add)
    }

    /// Appends another plan.
    pub fn and(mut self, other: Plan) -> Plan {
        self.0.extend(other.0);
        self
    }
}

/// A live buffer, for callers that record their own commands next to glint's. The owner keeps it alive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Held {
    /// The buffer's debug name.
    pub name: &'static str,
    /// Has usage storage, indirect, and transfer in both directions.
    pub buffer: vk::Buffer,
    /// Bytes.
    pub bytes: u64,
}

impl Held {
    pub(crate) fn of<T: Pod>(name: &'static str, buffer: &Buffer<T>) -> Self {
        Held { name, buffer: buffer.raw().handle(), bytes: buffer.raw().bytes_len() }
    }
}

/// Declares a struct of device buffers together with their sizes. `plan` returns the sizes and `new` makes
/// the buffers. `remake` replaces them one by one, so that at most one is held twice at any time.
macro_rules! buffers {
    ($(#[$meta:meta])* $vis:vis struct $Name:ident($options:ident: $Options:ty) {
        $($(#[$field_meta:meta])* $field_vis:vis $field:ident: $T:ty = $len:expr,)*
    }) => {
        $(#[$meta])*
        $vis struct $Name {
            $($(#[$field_meta])* $field_vis $field: $crate::gpu::Buffer<$T>,)*
        }

        #[allow(dead_code, reason = "not every set is remade or printed")]
        impl $Name {
            /// Sizes of the buffers, without making them.
            $vis fn plan($options: &$Options) -> $crate::pipelines::plan::Plan {
                $crate::pipelines::plan::Plan(vec![$($crate::pipelines::plan::Planned {
                    name: stringify!($field),
                    elements: ($len) as u64,
                    element_bytes: size_of::<$T>() as u64,
                },)*])
            }

            /// Lists the buffers, in the plan's order.
            $vis fn held(&self) -> Vec<$crate::pipelines::plan::Held> {
                vec![$($crate::pipelines::plan::Held::of(stringify!($field), &self.$field),)*]
            }

            /// Makes the buffers, uninitialised.
            $vis fn new(context: &$crate::gpu::Context, $options: &$Options) -> Result<Self, $crate::gpu::GpuError> {
                Ok($Name {
                    $($field: $crate::gpu::Buffer::new(
                        context, stringify!($field), ($len) as usize, $crate::gpu::Location::Device,
                    )?,)*
                })
            }

            /// Replaces the buffers by ones of other sizes, one after the other; contents are lost. After an
            /// error some are new and some old.
            $vis fn remake(&mut self, context: &$crate::gpu::Context, $options: &$Options) -> Result<(), $crate::gpu::GpuError> {
                $(self.$field = $crate::gpu::Buffer::new(
                    context, stringify!($field), ($len) as usize, $crate::gpu::Location::Device,
                )?;)*
                Ok(())
            }
        }
    };
}
pub(crate) use buffers;

/// The buffers of a kernel: first those with a value of their own, as in a struct expression, then after each
/// struct the names of those that are fields of it.
macro_rules! bind {
    ($kernel:ident { $($from:expr => $($field:ident),+;)+ }) => {
        $kernel::Buffers { $($($field: &$from.$field,)+)+ }
    };
    ($kernel:ident { $($own:ident $(: $value:expr)?),+; $($from:expr => $($field:ident),+;)+ }) => {
        $kernel::Buffers { $($own $(: $value)?,)+ $($($field: &$from.$field,)+)+ }
    };
}
pub(crate) use bind;
