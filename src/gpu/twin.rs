//! Functions of the host that stand in for kernels, so that the one which a driver compiles wrongly can be found. What they
//! compute is the business of whoever hands them to [`ContextOptions`](super::ContextOptions).

use std::slice;

use bytemuck::Pod;

/// Stands in for a kernel wherever a context runs it.
#[derive(Debug, Clone, Copy)]
pub struct Twin {
    /// [`Kernel::NAME`](super::Kernel::NAME).
    pub stage: &'static str,
    /// Does to copies of the bound buffers what the dispatch would do to the buffers. What it says where it cannot comes out of
    /// [`Recorder::submit`](super::Recorder::submit).
    pub run: fn(&mut TwinCall) -> Result<(), String>,
}

/// How many workgroups a dispatch has, and of how many threads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Workgroups {
    /// In each dimension; kernels fold them into one number.
    pub count: [u32; 3],
    /// Threads of each.
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

/// What a kernel would have been given. Each kernel's generated `Host` has it with types.
pub struct TwinCall {
    /// How many, and how large they are.
    pub workgroups: Workgroups,
    /// Ids and values, as the pipeline was made with.
    pub spec: Vec<(u32, u32)>,
    /// Push constants, in scalar layout.
    pub push: Vec<u8>,
    /// One for each binding, even where the same buffer is bound twice.
    pub bindings: Vec<HostBuffer>,
}

impl TwinCall {
    /// The specialisation constant of that id; 0 where the pipeline has none.
    pub fn constant(&self, id: u32) -> u32 {
        self.spec.iter().find(|(i, _)| *i == id).map_or(0, |(_, value)| *value)
    }
}

/// A copy of a buffer.
pub struct HostBuffer {
    /// Words, lest elements lie where their type does not allow it.
    words: Vec<u32>,
    bytes: usize,
}

impl HostBuffer {
    /// A copy of a buffer's contents.
    pub fn new(bytes: &[u8]) -> Self {
        HostBuffer { words: bytemuck::pod_collect_to_vec(bytes), bytes: bytes.len() }
    }

    /// What the twin left.
    pub fn bytes(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.words)[..self.bytes]
    }

    /// As many whole elements as there are: an [`Unused`](super::Unused) has fewer than a kernel's buffer has elsewhere.
    pub fn elements<T: Pod>(&mut self) -> &mut [T] {
        let bytes: &mut [u8] = &mut bytemuck::cast_slice_mut(&mut self.words)[..self.bytes];
        let whole = bytes.len() - bytes.len() % size_of::<T>().max(1);
        bytemuck::try_cast_slice_mut(&mut bytes[..whole]).unwrap_or_default()
    }
}

/// The elements of the next binding; none where there is no other.
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
