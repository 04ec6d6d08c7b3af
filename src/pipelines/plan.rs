//! The sizes of everything that a run holds on the device, as data: known before anything is made, and printable.

use std::fmt;

use ash::vk;
use bytemuck::Pod;

use crate::gpu::Buffer;

/// One buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Planned {
    /// The buffer's debug name.
    pub name: &'static str,
    /// How many there are.
    pub elements: u64,
    /// Bytes of each.
    pub element_bytes: u64,
}

impl Planned {
    /// Bytes of device memory.
    pub fn bytes(&self) -> u64 {
        // A buffer has one element at least: Vulkan has no empty ones.
        self.elements.max(1).saturating_mul(self.element_bytes)
    }
}

/// Buffers that are made together.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Plan(pub Vec<Planned>);

/// Bytes of device memory.
impl Plan {
    /// Of all its buffers.
    pub fn bytes(&self) -> u64 {
        self.0.iter().map(Planned::bytes).fold(0, u64::saturating_add)
    }

    /// Both together.
    pub fn and(mut self, other: Plan) -> Plan {
        self.0.extend(other.0);
        self
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for buffer in &self.0 {
            writeln!(
                f,
                "{:<24} {:>14} × {:>3} = {:>15}",
                buffer.name,
                buffer.elements,
                buffer.element_bytes,
                buffer.bytes()
            )?;
        }
        writeln!(f, "{:<24} {:>14}   {:>3}   {:>15}", "all", "", "", self.bytes())
    }
}

/// A buffer that is there: for whoever records commands of their own beside glint's. Whoever holds it keeps it alive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Held {
    /// The buffer's debug name.
    pub name: &'static str,
    /// Of usage storage, indirect and transfer both ways.
    pub buffer: vk::Buffer,
    /// Bytes.
    pub bytes: u64,
}

impl Held {
    pub(crate) fn of<T: Pod>(name: &'static str, buffer: &Buffer<T>) -> Self {
        Held { name, buffer: buffer.raw().handle(), bytes: buffer.raw().bytes_len() }
    }
}

/// Declares a struct of device buffers with their sizes beside them: `plan` says them, `new` makes them, `remake` makes them
/// anew one by one, so that beside what there is only one of them is ever held twice.
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
            /// What the buffers take, without making them.
            $vis fn plan($options: &$Options) -> $crate::pipelines::plan::Plan {
                $crate::pipelines::plan::Plan(vec![$($crate::pipelines::plan::Planned {
                    name: stringify!($field),
                    elements: ($len) as u64,
                    element_bytes: size_of::<$T>() as u64,
                },)*])
            }

            /// The buffers, in the plan's order.
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

            /// Makes them anew for other sizes, one after the other: contents are lost. After an error some are new and some old.
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
