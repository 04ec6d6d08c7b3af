//! What the generated list of kernels expands to: for each kernel a module with its interface, typed for the host and for its twin.

use crate::gpu::ConstantKind;

/// A value of a specialisation constant.
pub(super) trait SpecValue: Copy {
    const KIND: ConstantKind;
    fn of(word: u32) -> Self;
    fn word(self) -> u32;
}

macro_rules! spec_value {
    ($type:ty, $kind:ident, $of:expr, $word:expr) => {
        impl SpecValue for $type {
            const KIND: ConstantKind = ConstantKind::$kind;
            fn of(word: u32) -> Self {
                $of(word)
            }
            fn word(self) -> u32 {
                $word(self)
            }
        }
    };
}
spec_value!(u32, U32, |word| word, |value| value);
spec_value!(i32, I32, |word: u32| word as i32, |value: i32| value as u32);
spec_value!(f32, F32, f32::from_bits, f32::to_bits);
spec_value!(bool, Bool, |word| word != 0, u32::from);

/// Elements of a binding for a twin; exclusive if the kernel writes them.
macro_rules! elements {
    ($life:lifetime Read $type:ty) => { &$life [$type] };
    ($life:lifetime $access:ident $type:ty) => { &$life mut [$type] };
}

/// A name as debuggers take it.
macro_rules! label {
    ($name:ident) => {
        match std::ffi::CStr::from_bytes_with_nul(concat!(stringify!($name), "\0").as_bytes()) {
            Ok(label) => label,
            Err(_) => panic!("a name with a zero"),
        }
    };
}

/// Declares the module of a kernel. `buffers` are in the order of bindings: access, name, element, and which words of an element are
/// floats. The first module of `spirv` uses subgroup operations, the second shared memory in their place.
macro_rules! kernel {
    (
        $(#[$doc:meta])*
        $name:ident, $unit:ident, subgroups $subgroups:literal, barriers $barriers:literal, features [$($feature:ident),*],
        spirv $spirv:literal $software:literal,
        push { $($push:ident: $push_type:ty,)* }
        spec { $($id:literal $spec:ident: $spec_type:ty,)* }
        buffers { $($access:ident $buffer:ident: $element:ty = $floats:literal,)* }
    ) => {
        $(#[$doc])*
        pub mod $name {
            #[allow(unused_imports)]
            use super::types::*;
            use super::super::kernel::SpecValue;
            use crate::gpu;

            /// Push constants.
            #[repr(C)]
            #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
            pub struct Push { $(pub $push: $push_type,)* }

            /// Specialisation constants.
            #[derive(Clone, Copy, Debug)]
            pub struct Spec { $(pub $spec: $spec_type,)* }

            /// Buffers by binding.
            #[derive(Clone, Copy)]
            pub struct Buffers<'a> { $(#[doc = stringify!($access)] pub $buffer: &'a gpu::Buffer<$element>,)* }

            /// What a twin of the kernel is given; see [`gpu::Twin`].
            pub struct Host<'a> {
                pub workgroups: gpu::Workgroups,
                pub spec: Spec,
                pub push: Push,
                $(#[doc = stringify!($access)] pub $buffer: elements!('a $access $element),)*
            }

            impl<'a> Host<'a> {
                pub fn new(call: &'a mut gpu::TwinCall) -> Self {
                    let spec = Spec { $($spec: SpecValue::of(call.constant($id)),)* };
                    let (workgroups, push) = (call.workgroups, bytemuck::pod_read_unaligned(&call.push));
                    let mut bindings = call.bindings.iter_mut();
                    Host { workgroups, spec, push, $($buffer: gpu::next_binding(&mut bindings),)* }
                }
            }

            pub struct Kernel;
            pub type Stage = gpu::Pipeline<Kernel>;

            impl gpu::Kernel for Kernel {
                const NAME: &'static str = stringify!($name);
                const LABEL: &'static std::ffi::CStr = label!($name);
                const SPIRV: &'static [u8] = &gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/", $spirv))).0;
                const SOFTWARE_SPIRV: &'static [u8] =
                    &gpu::Words(*include_bytes!(concat!(env!("OUT_DIR"), "/", $software))).0;
                const BINDINGS: &'static [gpu::Binding] = &[$(gpu::Binding {
                    name: label!($buffer),
                    access: gpu::Access::$access,
                    element_bytes: size_of::<$element>() as u32,
                    floats: $floats,
                },)*];
                const CONSTANTS: &'static [gpu::Constant] =
                    &[$(gpu::Constant { id: $id, name: label!($spec), kind: <$spec_type as SpecValue>::KIND },)*];
                const UNIT: gpu::Unit = gpu::Unit::$unit;
                const SUBGROUPS: bool = $subgroups;
                const BARRIERS: bool = $barriers;
                const FEATURES: &'static [gpu::Feature] = &[$(gpu::Feature::$feature),*];
                type Push = Push;
                type Spec = Spec;
                type Buffers<'a> = Buffers<'a>;
                fn spec_words(spec: &Spec) -> Vec<(u32, u32)> {
                    vec![$(($id, spec.$spec.word()),)*]
                }
                fn raw_buffers<R>(
                    b: &Self::Buffers<'_>,
                    with: impl FnOnce(&[&std::sync::Arc<gpu::RawBuffer>]) -> R,
                ) -> R {
                    with(&[$(b.$buffer.raw(),)*])
                }
            }
        }
    };
}
