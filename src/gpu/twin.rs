//! Host functions that replace kernels, or check them on the same inputs, to find one that a driver
//! miscompiles. The code that passes them to [`ContextOptions`](super::ContextOptions) defines the
//! computation.

use std::{ffi::CStr, fmt, slice, sync::Arc, time::Duration};

use bytemuck::Pod;

use super::{Binding, Constant};

/// A host function that replaces a kernel in a context.
#[derive(Debug, Clone, Copy)]
pub struct Twin {
    /// [`Kernel::NAME`](super::Kernel::NAME).
    pub stage: &'static str,
    /// Does to copies of the bound buffers what the dispatch would do to the buffers.
    /// [`Recorder::submit`](super::Recorder::submit) returns its error if it fails.
    pub run: fn(&mut TwinCall) -> Result<(), String>,
}

/// A dispatch, and its twin's results from copies of the same buffers.
pub struct Shadowed<'a> {
    /// [`Kernel::NAME`](super::Kernel::NAME).
    pub stage: &'static str,
    /// The kernel's bindings, in the order of the buffers below.
    pub bindings: &'static [Binding],
    /// The kernel's specialisation constants.
    pub constants: &'static [Constant],
    /// The twin's inputs, with the buffers as it left them.
    pub twin: &'a TwinCall,
    /// The buffers as the kernel left them.
    pub kernel: &'a [HostBuffer],
    /// The buffers before.
    pub before: &'a [HostBuffer],
    /// The twin's error, if it returned one.
    pub failed: Option<String>,
    /// Duration of the kernel on the device; `None` without timestamps.
    pub time: Option<Duration>,
}

impl Shadowed<'_> {
    /// Returns the words of a buffer before the dispatch; empty if the kernel has no buffer of this name.
    pub fn before(&self, name: &CStr) -> &[u32] {
        let at = self.bindings.iter().position(|binding| binding.name == name);
        at.map_or(&[], |at| self.before[at].words())
    }

    /// Returns a specialisation constant; 0 if the kernel has none of this name.
    pub fn constant(&self, name: &CStr) -> u32 {
        self.constants
            .iter()
            .find(|constant| constant.name == name)
            .map_or(0, |constant| self.twin.constant(constant.id))
    }
}

/// Compares the dispatches of a context with twins.
#[derive(Clone)]
pub struct Judge {
    /// Twins, which run on copies of their kernels' buffers.
    pub twins: Vec<Twin>,
    /// Called after every dispatch of a kernel that has a twin.
    pub judge: Arc<dyn Fn(&Shadowed<'_>) + Send + Sync>,
}

impl fmt::Debug for Judge {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Judge")
    }
}

/// Number and size of a dispatch's workgroups.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Workgroups {
    /// Workgroups in each dimension; kernels fold them into one number.
    pub count: [u32; 3],
    /// Threads of a workgroup.
    pub size: u32,
    /// Threads of a subgroup.
    pub lanes: u32,
}

impl Workgroups {
    /// Workgroups of the dispatch.
    pub fn groups(&self) -> usize {
        self.count.iter().map(|&n| n as usize).product()
    }

    /// Threads of the dispatch.
    pub fn threads(&self) -> usize {
        self.groups() * self.size as usize
    }

    /// Subgroups of the dispatch.
    pub fn subgroups(&self) -> usize {
        self.groups() * (self.size / self.lanes.max(1)) as usize
    }
}

/// Inputs of a kernel. Each kernel's generated `Host` has them with types.
pub struct TwinCall {
    /// Number and size of the workgroups.
    pub workgroups: Workgroups,
    /// Ids and values of the pipeline's specialisation constants.
    pub spec: Vec<(u32, u32)>,
    /// Push constants, in scalar layout.
    pub push: Vec<u8>,
    /// Copies of the buffers, one for each binding, even if the same buffer is bound twice.
    pub bindings: Vec<HostBuffer>,
}

impl TwinCall {
    /// The specialisation constant of that id; 0 if the pipeline has none.
    pub fn constant(&self, id: u32) -> u32 {
        self.spec.iter().find(|(i, _)| *i == id).map_or(0, |(_, value)| *value)
    }
}

/// A copy of a buffer.
#[derive(Clone)]
pub struct HostBuffer {
    /// Words, so that elements are aligned for their types.
    words: Vec<u32>,
    bytes: usize,
}

impl HostBuffer {
    /// A copy of a buffer's contents.
    pub fn new(bytes: &[u8]) -> Self {
        HostBuffer { words: bytemuck::pod_collect_to_vec(bytes), bytes: bytes.len() }
    }

    /// The contents.
    pub fn bytes(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.words)[..self.bytes]
    }

    /// The contents as whole words.
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// The contents as whole elements. An [`Unused`](super::Unused) may have fewer than a kernel's buffer
    /// otherwise has.
    pub fn elements<T: Pod>(&mut self) -> &mut [T] {
        let bytes: &mut [u8] = &mut bytemuck::cast_slice_mut(&mut self.words)[..self.bytes];
        let whole = bytes.len() - bytes.len() % size_of::<T>().max(1);
        bytemuck::try_cast_slice_mut(&mut bytes[..whole]).unwrap_or_default()
    }
}

/// The elements of the next binding; none after the last.
pub fn next_binding<'a, T: Pod>(bindings: &mut slice::IterMut<'a, HostBuffer>) -> &'a mut [T] {
    bindings.next().map(HostBuffer::elements).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buffers_have_whole_elements_of_any_type() {
        let mut buffer = HostBuffer::new(&[1, 0, 0, 0, 2, 0, 0]);
        assert_eq!(buffer.elements::<u32>(), [1]);
        assert_eq!(buffer.elements::<u16>(), [1, 0, 2]);
        buffer.elements::<u8>()[6] = 9;
        assert_eq!(buffer.bytes(), [1, 0, 0, 0, 2, 0, 9]);
        assert_eq!(HostBuffer::new(&[]).elements::<[f32; 3]>(), [[0f32; 3]; 0]);
    }
}
