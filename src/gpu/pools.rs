//! Command, query and descriptor pools of recorders, and their reuse.

use std::time::Duration;

use ash::vk;

use super::{Check, Context, GpuError, needs};

/// Stages that one recorder can time; later ones are recorded untimed.
const MAX_TIMED: u32 = 2047;

/// A command pool with its one buffer, a fence and a query pool; reused once the work is done.
pub(super) struct CommandSlot {
    pub pool: vk::CommandPool,
    pub commands: vk::CommandBuffer,
    pub fence: vk::Fence,
    pub stamps: Stamps,
    pub sets: Sets,
}

/// # Safety
/// The device is done with the slot.
pub(super) unsafe fn destroy_slot(device: &ash::Device, slot: CommandSlot) {
    // SAFETY: by the contract above.
    unsafe {
        device.destroy_fence(slot.fence, None);
        slot.stamps.destroy(device);
        slot.sets.destroy(device);
        device.destroy_command_pool(slot.pool, None);
    }
}

/// One stage's time on the device.
#[derive(Debug, Clone, Copy)]
pub struct StageTime {
    /// The kernel's name; or `fill` or `copy`, the two commands that are not kernels.
    pub name: &'static str,
    /// Time between the timestamps before and after it, including its barrier.
    pub time: Duration,
}

/// A timestamp before the first stage and one after each.
pub(super) struct Stamps {
    queries: vk::QueryPool,
    names: Vec<&'static str>,
}

impl Stamps {
    pub fn new(device: &ash::Device) -> Result<Self, GpuError> {
        let info = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(MAX_TIMED + 1);
        // SAFETY: the structure lives for the call.
        let queries = unsafe { device.create_query_pool(&info, None) }.check("vkCreateQueryPool")?;
        let mut stamps = Stamps { queries, names: Vec::with_capacity(MAX_TIMED as usize) };
        // SAFETY: the pool is new.
        unsafe { stamps.reset(device) };
        Ok(stamps)
    }

    /// # Safety
    /// The device is done with the recorded commands.
    pub unsafe fn reset(&mut self, device: &ash::Device) {
        self.names.clear();
        // SAFETY: by the contract above; `hostQueryReset` is enabled.
        unsafe { device.reset_query_pool(self.queries, 0, MAX_TIMED + 1) };
    }

    /// # Safety
    /// `commands` is recording.
    pub unsafe fn begin(&self, device: &ash::Device, commands: vk::CommandBuffer) {
        // SAFETY: by the contract above; the pool was reset.
        unsafe { device.cmd_write_timestamp(commands, vk::PipelineStageFlags::BOTTOM_OF_PIPE, self.queries, 0) };
    }

    /// # Safety
    /// Those of `begin`.
    pub unsafe fn stamp(&mut self, device: &ash::Device, commands: vk::CommandBuffer, name: &'static str) {
        if self.names.len() < MAX_TIMED as usize {
            self.names.push(name);
            let (stage, index) = (vk::PipelineStageFlags::BOTTOM_OF_PIPE, self.names.len() as u32);
            // SAFETY: by the contract above; the pool was reset and holds MAX_TIMED + 1 queries.
            unsafe { device.cmd_write_timestamp(commands, stage, self.queries, index) };
        }
    }

    pub fn read(&self, context: &Context) -> Result<Vec<StageTime>, GpuError> {
        let mut stamps = vec![0u64; self.names.len() + 1];
        if self.names.is_empty() {
            return Ok(vec![]);
        }
        let flags = vk::QueryResultFlags::TYPE_64;
        // SAFETY: this number was recorded; queries that are not written are an error.
        unsafe { context.0.device.get_query_pool_results(self.queries, 0, &mut stamps, flags) }
            .check("vkGetQueryPoolResults")?;
        let (period, mask) = (f64::from(context.info().timestamp_period), context.0.facts.timestamp_mask);
        let time = |w: &[u64]| Duration::from_nanos((ticks(w[0], w[1], mask) as f64 * period) as u64);
        Ok(self.names.iter().zip(stamps.windows(2)).map(|(&name, w)| StageTime { name, time: time(w) }).collect())
    }

    /// # Safety
    /// Those of `reset`.
    unsafe fn destroy(self, device: &ash::Device) {
        // SAFETY: by the contract above.
        unsafe { device.destroy_query_pool(self.queries, None) };
    }
}

/// Descriptor sets, for devices without push descriptors: one for each dispatch, freed together.
#[derive(Default)]
pub(super) struct Sets {
    pools: Vec<vk::DescriptorPool>,
    used: usize,
}

impl Sets {
    /// Sets in a pool, each with the capacity for the buffers of any kernel.
    const OF_POOL: usize = 256;

    pub fn allocate(
        &mut self,
        device: &ash::Device,
        layout: vk::DescriptorSetLayout,
    ) -> Result<vk::DescriptorSet, GpuError> {
        let pool = self.used / Self::OF_POOL;
        if pool == self.pools.len() {
            let sizes = [vk::DescriptorPoolSize {
                ty: vk::DescriptorType::STORAGE_BUFFER,
                descriptor_count: Self::OF_POOL as u32 * needs::STORAGE_BUFFERS,
            }];
            let info = vk::DescriptorPoolCreateInfo::default().max_sets(Self::OF_POOL as u32).pool_sizes(&sizes);
            // SAFETY: the structures live for the call.
            self.pools.push(unsafe { device.create_descriptor_pool(&info, None) }.check("vkCreateDescriptorPool")?);
        }
        let layouts = [layout];
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(self.pools[pool]).set_layouts(&layouts);
        // SAFETY: the pool has room for one more; the layout is alive.
        let sets = unsafe { device.allocate_descriptor_sets(&info) }.check("vkAllocateDescriptorSets")?;
        self.used += 1;
        Ok(sets[0])
    }

    /// # Safety
    /// The device is done with the recorded commands.
    pub unsafe fn reset(&mut self, device: &ash::Device) -> Result<(), vk::Result> {
        for &pool in &self.pools[..self.used.div_ceil(Self::OF_POOL)] {
            // SAFETY: by the contract above.
            unsafe { device.reset_descriptor_pool(pool, vk::DescriptorPoolResetFlags::empty()) }?;
        }
        self.used = 0;
        Ok(())
    }

    /// # Safety
    /// Those of `reset`.
    unsafe fn destroy(self, device: &ash::Device) {
        // SAFETY: by the contract above.
        self.pools.into_iter().for_each(|pool| unsafe { device.destroy_descriptor_pool(pool, None) });
    }
}

/// Pools that a caller's command buffers use.
pub(super) struct Pools {
    pub context: Context,
    pub stamps: Option<Stamps>,
    pub sets: Sets,
}

impl Drop for Pools {
    fn drop(&mut self) {
        let device = &self.context.0.device;
        // SAFETY: a `Kept` outlives the commands that were recorded with it.
        unsafe {
            self.stamps.take().into_iter().for_each(|stamps| stamps.destroy(device));
            std::mem::take(&mut self.sets).destroy(device);
        }
    }
}

/// Ticks between two timestamps with the valid bits `mask`. They wrap to 0 at most once in between. Half of
/// the range or more means that the clock went back, and counts as 0.
fn ticks(from: u64, to: u64, mask: u64) -> u64 {
    let ticks = to.wrapping_sub(from) & mask;
    if ticks <= mask / 2 { ticks } else { 0 }
}

pub(super) fn make_slot(context: &Context) -> Result<CommandSlot, GpuError> {
    let inner = &context.0;
    let device = &inner.device;
    // SAFETY: structures live for their calls; on failure what was made before is destroyed.
    unsafe {
        let pool_info = vk::CommandPoolCreateInfo::default().queue_family_index(inner.queue.family);
        let pool = device.create_command_pool(&pool_info, None).check("vkCreateCommandPool")?;
        let stamps = match Stamps::new(device) {
            Ok(stamps) => stamps,
            Err(e) => {
                device.destroy_command_pool(pool, None);
                return Err(e);
            }
        };
        let (commands, fence) = (vk::CommandBuffer::null(), vk::Fence::null());
        let mut slot = CommandSlot { pool, commands, fence, stamps, sets: Sets::default() };
        let info = vk::CommandBufferAllocateInfo::default()
            .command_pool(pool)
            .level(vk::CommandBufferLevel::PRIMARY)
            .command_buffer_count(1);
        let made = (|| {
            slot.commands = device.allocate_command_buffers(&info).check("vkAllocateCommandBuffers")?[0];
            slot.fence = device.create_fence(&vk::FenceCreateInfo::default(), None).check("vkCreateFence")?;
            Ok(())
        })();
        match made {
            Ok(()) => Ok(slot),
            Err(e) => {
                destroy_slot(device, slot);
                Err(e)
            }
        }
    }
}

/// Prepares a slot whose work is done for the next recorder.
pub(super) fn recycle(context: &Context, mut slot: CommandSlot) {
    let device = &context.0.device;
    // SAFETY: the device is done with the slot (or never saw it).
    let reset = unsafe {
        slot.stamps.reset(device);
        device
            .reset_command_pool(slot.pool, vk::CommandPoolResetFlags::empty())
            .and_then(|()| slot.sets.reset(device))
            .and_then(|()| device.reset_fences(&[slot.fence]))
    };
    match (reset, context.0.free_slots.lock()) {
        (Ok(()), Ok(mut list)) => list.push(slot),
        // SAFETY: as above.
        _ => unsafe { destroy_slot(device, slot) },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn timestamps_of_few_bits_begin_again_at_0() {
        assert_eq!(ticks(5, 9, u64::MAX), 4);
        // 36 bits; a driver may leave anything above them.
        let mask = (1 << 36) - 1;
        assert_eq!(ticks(0xABC0_0000_0000_0000 | (mask - 2), 0x1230_0000_0000_0007, mask), 10);
        assert_eq!((ticks(9, 5, u64::MAX), ticks(9, 5, 0)), (0, 0));
    }
}
